"""The built-in scene `arcade`: free ways, and materials that fool robots."""

import numpy as np
import pytest

from omnisim.scene import load_scene
from omnisim.scene.space.floor import triangles_within
from omnisim.scene.surface_kind import SurfaceKind, kind_of, transmitted

HALF_WIDTH_M, CLEARANCE_M, HEIGHTS_M = 0.25, 0.3, (0.02, 1.2)


@pytest.fixture(scope="module")
def scene():
    return load_scene("arcade")


def test_a_vehicle_clears_everything_along_the_stroll(scene):
    """Also between the two ways; a passage that is 1 m wider is not free."""
    corners = np.array(scene.paths[0].waypoints_m)

    def obstacles(reach_m):
        low, high = corners.min(axis=0) - reach_m, corners.max(axis=0) + reach_m
        z = triangles_within(scene, low, high).corners_m[..., 2]
        return np.sum((z.max(axis=1) > HEIGHTS_M[0]) & (z.min(axis=1) < HEIGHTS_M[1]))

    assert obstacles(HALF_WIDTH_M + CLEARANCE_M) == 0
    assert obstacles(HALF_WIDTH_M + CLEARANCE_M + 0.5) > 0


def test_starts_are_on_the_stroll(scene):
    corners = np.array(scene.paths[0].waypoints_m)
    for start in scene.starts:
        assert abs(start.position_m[1]) == pytest.approx(0.7)
        assert corners[:, 0].min() <= start.position_m[0] <= corners[:, 0].max()


def test_surfaces_are_of_every_kind_that_fools_robots(scene):
    materials = {material.name: material for material in scene.materials}

    def names(kind):
        return {name for name, material in materials.items() if kind_of(material) & kind}

    assert names(SurfaceKind.PLANAR_PANE) == {"pane", "roof_glass"}
    assert transmitted(materials["frosted"], SurfaceKind.FROSTED) == 1.0
    assert len(names(SurfaceKind.GLASS)) == 5
    mirrors = names(SurfaceKind.PLANAR_MIRROR)
    assert mirrors >= {"mirror", "brushed_steel", "terrazzo_light"}
    assert materials["terrazzo_light"].roughness == pytest.approx(0.1)
    assert scene.lighting.baked is not None
    assert scene.lighting.lights == ()
