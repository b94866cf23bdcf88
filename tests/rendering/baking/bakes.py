"""Bakes of small scenes, their light at places, and form factors."""

import numpy as np

from omnisim.rendering.baking.bake import Bake, TileFolder, no_progress
from omnisim.rendering.baking.settings import BakeSettings


def lit(tmp_path, scene, **settings):
    """Bake of a scene and its light, without probes."""
    bake, folder = Bake(scene, BakeSettings(**settings)), TileFolder(tmp_path / "x.baked", {})
    found = bake.run(folder, 1, no_progress)
    folder.remove()
    return bake, found


def baked(tmp_path, scene, **settings):
    """Bake of a scene, its light, and its probes."""
    bake, found = lit(tmp_path, scene, **settings)
    return bake, found, bake.probes(TileFolder(tmp_path / "x.baked", {}), found, 1, no_progress)


def at(bake, light, surface, place, normal=(0.0, 0.0, 1.0), within_m=0.15):
    """Mean light (3,) of an instance's patches near a place, that face along a normal."""
    surfaces = bake.surfaces(np.ones(bake.patches.count, dtype=bool))
    positions = surfaces.positions_m + bake.transport.center_m
    near = np.linalg.norm(positions - place, axis=1) < within_m
    near &= surfaces.normals @ np.array(normal) > 0.99
    near &= (bake.patches.surfaces == surface) & (np.diff(bake.patches.first) > 0)
    assert near.any()
    return light[near].mean(axis=0)


def share_of_corner(a, b):
    """Share of light that a rectangle gives a point below its corner, its sides over the height.

    Source: Howell, "A catalog of radiation heat transfer configuration factors", B-3.
    """
    first, second = np.hypot(1.0, a), np.hypot(1.0, b)
    return (a / first * np.arctan(b / first) + b / second * np.arctan(a / second)) / (2.0 * np.pi)
