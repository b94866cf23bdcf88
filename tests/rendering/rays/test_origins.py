"""Images and hits of a camera whose rays do not meet in one point, by formulas."""

import math
from dataclasses import dataclass

import numpy as np
import pytest

from omnisim.cameras import EquidistantCamera, Rays, pixel_grid
from omnisim.core.poses import pose
from tests.scenes import room, room_color, room_hit, scene_of

pytest.importorskip("embreex", reason="embreex, which casts the rays, is missing")

from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.contract import CameraSetup, ScenePoses
from omnisim.rendering.rays.caster import DepthLimits
from omnisim.rendering.rays.ray_backend import RayHitSource, RayImage
from omnisim.rendering.rays.ray_scene import ObjectState, RayScene


@dataclass(frozen=True)
class AxialCamera(EquidistantCamera):
    """Rays that start along the axis: the farther from it they look, the higher."""

    def ray_from_pixel(self, pixels_px):
        """As the lens, from 0 to 0.4 m along the axis."""
        rays = super().ray_from_pixel(pixels_px)
        heights_m = 0.4 * (1.0 - rays.directions[..., 2]) / 2.0
        return Rays(rays.directions, rays.valid, heights_m[..., None] * np.array([0.0, 0.0, 1.0]))


def test_each_ray_starts_at_its_own_origin():
    camera = AxialCamera(40, 30, 12.0, (19.5, 14.5), math.radians(100.0))
    scene, world_from_rig = (
        RayScene(scene_of([room()])),
        pose((0.3, -0.2, 0.1), roll_deg=3.0, pitch_deg=-8.0, yaw_deg=40.0),
    )
    limits, still = DepthLimits(0.01, math.inf), ObjectState()
    rays = camera.ray_from_pixel(pixel_grid(camera.width_px, camera.height_px))
    world_from_optical = world_from_rig[:3, :3] @ camera.rig_from_optical
    origins = rays.origins_m[rays.valid] @ world_from_optical.T + world_from_rig[:3, 3]
    directions = rays.directions[rays.valid] @ world_from_optical.T
    assert np.ptp(rays.origins_m[..., 2]) > 0.15
    expected = room_hit(origins, directions)
    sensor = OmniCamera(camera, near_m=limits.near_m, far_m=limits.far_m)
    hits = RayHitSource(scene, CameraSetup(sensor)).hits(ScenePoses(world_from_rig))
    points = hits.points_m[rays.valid] + world_from_rig[:3, 3]
    np.testing.assert_allclose(points, expected, atol=1e-6)
    lengths_m = np.linalg.norm(expected - origins, axis=1)
    np.testing.assert_allclose(hits.ranges_m[rays.valid], lengths_m, rtol=1e-6)
    image = RayImage(scene, camera, None, 1, limits).render(world_from_rig, still)
    np.testing.assert_allclose(image[rays.valid, :3], room_color(expected), atol=1e-5)
