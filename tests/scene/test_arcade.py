"""The built-in scene `arcade`: free ways, and materials that fool robots."""

import numpy as np
import pytest

from omnisim.scene import load_scene
from omnisim.scene.planar_mirrors import is_clear_pane, is_planar_mirror
from omnisim.scene.space.floor import triangles_within

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
    materials = {one.name: one for one in scene.materials}
    assert {name for name, one in materials.items() if is_clear_pane(one)} == {"pane", "roof_glass"}
    assert materials["frosted"].frosted_transmission == 1.0
    assert sum(one.glass_transmission > 0.0 for one in materials.values()) == 5
    mirrors = {name for name, one in materials.items() if is_planar_mirror(one)}
    assert mirrors >= {"mirror", "brushed_steel", "terrazzo_light"}
    assert materials["terrazzo_light"].roughness == pytest.approx(0.1)
    assert scene.lighting.baked is not None
    assert scene.lighting.lights == ()
