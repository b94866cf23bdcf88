"""Mitsuba's fisheye, made of a cube's faces, in a room whose light is known in closed form."""

import numpy as np
import pytest

from omnisim.cameras import EquidistantCamera, pixel_grid
from omnisim.core.poses import pose
from omnisim.scene.model import Light, Lighting, LightKind
from tests.scenes import ROOM_HALF_M, room, room_color, room_hit, scene_of

pytest.importorskip("mitsuba", reason="Mitsuba is an optional oracle")
from omnisim.validation.oracles.mitsuba_light import matte_on_both_sides, trace_lit_fisheye

LAMP_M, LEVEL = np.array([0.4, -0.3, 0.2]), 3.0
POSES = {
    "level": np.eye(4),
    "any way": pose((-0.5, 0.6, -0.2), roll_deg=25.0, pitch_deg=-130.0, yaw_deg=70.0),
}


def _light(points_m):
    """Light (..., 3) of the lamp off the walls."""
    walls = np.argmax(np.abs(points_m) / ROOM_HALF_M, axis=-1)[..., None]
    away_m = points_m - LAMP_M
    distance_m = np.linalg.norm(away_m, axis=-1, keepdims=True)
    cosine = np.abs(np.take_along_axis(away_m, walls, axis=-1)) / distance_m
    return LEVEL * room_color(points_m) * cosine / distance_m**2


@pytest.mark.parametrize("at", POSES.values(), ids=POSES.keys())
@pytest.mark.parametrize("theta_deg", [95.0, 170.0])
def test_a_room_with_a_lamp(at, theta_deg):
    """Each channel is a different axis of the room: no turn and no mirroring looks the same."""
    theta = np.deg2rad(theta_deg)
    camera = EquidistantCamera(34, 30, 15.0 / theta, (17.25, 14.5), theta)
    lamp = Light(LightKind.POINT, (1.0, 1.0, 1.0), LEVEL, position_m=LAMP_M)
    lighting = Lighting(ambient=(0.0, 0.0, 0.0), lights=(lamp,), exposure=1.0)
    scene = matte_on_both_sides(scene_of([room()], lighting=lighting))
    traced = trace_lit_fisheye(scene, camera, at, 4)
    side = 6
    fine = (pixel_grid(34 * side, 30 * side) + 0.5) / side - 0.5
    rays, valid = camera.ray_from_pixel(fine)[:2]
    points_m = room_hit(at[:3, 3], np.nan_to_num(rays) @ at[:3, :3].T)
    ours = _light(points_m).reshape(30, side, 34, side, 3).mean(axis=(1, 3))
    inside = valid.reshape(30, side, 34, side).all(axis=(1, 3))
    assert inside.sum() > 500
    # an edge between walls is up to half a texel, an eighth of a pixel, aside
    difference = np.abs(traced - ours)[inside]
    assert difference.mean() < 0.003
    assert difference.max() < 0.1
