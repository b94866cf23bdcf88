"""Rooms whose light is known, their bakes, and form factors."""

import dataclasses

import numpy as np

from omnisim.rendering.baking.bake import Bake, TileFolder, no_progress
from omnisim.rendering.baking.settings import BakeSettings
from omnisim.scene import Scene
from omnisim.scene.model import Lighting, StartPose

DARK = Lighting((0.0, 0.0, 0.0), ())


def box(name, size_m, center_m=(0.0, 0.0, 0.0), color=(0.5, 0.5, 0.5), inwards=False):
    """A closed box, whose corners belong to one side each."""
    corners, triangles = [], []
    for axis in range(3):
        for sign in (-1.0, 1.0):
            across = np.roll(np.eye(3), 1, axis=0)[axis], np.roll(np.eye(3), 2, axis=0)[axis]
            u, v = across if (sign > 0) != inwards else across[::-1]
            base = sign * np.eye(3)[axis]
            if np.dot(np.cross(u, v), base) * (-1 if inwards else 1) < 0:
                u, v = v, u
            first = len(corners)
            corners += [base - u - v, base + u - v, base + u + v, base - u + v]
            triangles += [(first, first + 1, first + 2), (first, first + 2, first + 3)]
    positions = 0.5 * np.array(corners) * size_m + center_m
    return Scene.from_arrays(name, positions, triangles, base_color=color, double_sided=False)


def lit_by(scene, lighting=DARK, start_m=(0.0, 0.0, 0.0)):
    return dataclasses.replace(scene, lighting=lighting, start=StartPose(start_m))


def shining(scene, light, number=0):
    materials = list(scene.materials)
    materials[number] = dataclasses.replace(materials[number], emissive=(light,) * 3)
    return dataclasses.replace(scene, materials=tuple(materials))


def black_room(lighting=DARK):
    return lit_by(box("room", (4.0, 4.0, 3.0), color=(0.0, 0.0, 0.0), inwards=True), lighting)


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
