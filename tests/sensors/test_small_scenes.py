"""Scenes of less than a metre, down to a millimetre, against the ranges of a sphere."""

import numpy as np
import pytest
import trimesh

from omnisim import OmniCamera, Renderer, Scene
from omnisim.cameras import EquirectangularCamera


@pytest.mark.usefixtures("needs_opengl")
@pytest.mark.parametrize("radius_m", [0.01, 0.0005])
def test_a_small_object_is_seen_at_its_range(radius_m):
    ball = trimesh.creation.icosphere(4, radius_m)
    scene = Scene.from_arrays("ball", ball.vertices, ball.faces)
    with Renderer(scene, EquirectangularCamera(128, 64)) as renderer:
        base = renderer.camera.base_pose(scene.start.position_m, scene.start.yaw_deg)
        ranges_m = renderer.render(base, also=("range",)).channels["range"]
    distance_m = np.linalg.norm(scene.start.position_m)
    seen = ranges_m[np.isfinite(ranges_m)]
    # the cap of a sphere that is seen below its angular radius, on either side a pixel
    angle = np.arcsin(radius_m / distance_m)
    share = 0.5 * (1.0 - np.cos(angle))
    rows = np.pi * (np.arange(64) + 0.5) / 64
    weights = np.sin(rows)[:, None] * np.isfinite(ranges_m)
    assert weights.sum() / (128 * np.sin(rows).sum()) == pytest.approx(share, rel=0.05)
    assert seen.min() == pytest.approx(distance_m - radius_m, rel=0.005)  # of 5120 triangles
    assert seen.max() < np.sqrt(distance_m**2 - radius_m**2)


def test_a_near_plane_that_was_chosen_stays():
    assert OmniCamera(near_m=0.02).seeing(0.1).near_m == 0.02
    assert OmniCamera().seeing(0.1).near_m == pytest.approx(0.005)
    assert OmniCamera().seeing(10.0).near_m == 0.05
