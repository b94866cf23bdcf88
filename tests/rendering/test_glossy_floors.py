"""Glossy floors: without specks by lamps' highlights in glass and chrome, and seen in mirrors."""

import dataclasses

import numpy as np
import pytest
from scipy.ndimage import binary_erosion, median_filter

from omnisim.core.poses import pose
from omnisim.rendering.stage import open_sensor
from omnisim.scene.model import Light, Lighting, LightKind, Material
from omnisim.validation import reflective_rooms
from omnisim.validation.image_differences import psnr_of_levels_db
from omnisim.validation.material_chart import sphere
from tests.rendering.frames import each_backend, frame_of
from tests.scenes import room, scene_of, square, upright
from tests.slow import slow_but

pytestmark = pytest.mark.usefixtures("needs_opengl")
pytest.importorskip("embreex", reason="embreex, which casts the rays, is missing")

WALLS = Material(double_sided=True)
GLOSS = Material(base_color=(0.3, 0.25, 0.2, 1.0), roughness=0.2, specular=1.0)
CHROME = Material(
    base_color=(0.95, 0.95, 0.95, 1.0), metallic=1.0, roughness=0.0, double_sided=True
)
PANE = Material(roughness=0.0, specular=1.0, transmission=1.0, double_sided=True)
LIGHTS = (
    Light(LightKind.POINT, (1.0, 0.95, 0.9), 1.5, np.array((0.8, -1.0, 1.2))),
    Light(LightKind.POINT, (0.9, 0.95, 1.0), 1.5, np.array((-0.5, 1.2, 1.0))),
)
VIEWS = (
    pose((-1.4, 0.1, 0.0), pitch_deg=22.0),
    pose((-0.6, -1.2, -0.5), yaw_deg=25.0, pitch_deg=15.0),
    pose((0.1, 1.4, 0.4), yaw_deg=-60.0, pitch_deg=30.0),
    pose((-1.2, 0.8, -0.9), yaw_deg=-20.0, pitch_deg=6.0),
)
FLOOR = 2  # in the channel of instances


def _room(*others):
    """A room with a glossy floor, and others with their places."""
    meshes = [room(), square(1.9, -1.2, 1), *(mesh for mesh, _ in others)]
    places = [np.eye(4), np.eye(4), *(place for _, place in others)]
    lighting = Lighting((0.15, 0.15, 0.17), LIGHTS, exposure=0.5)
    return scene_of(meshes, [WALLS, GLOSS, CHROME, PANE], places, lighting)


@pytest.mark.parametrize("view", slow_but(range(4), 0))
@each_backend
def test_highlights_in_glass_and_chrome_are_no_specks_on_glossy_floors(backend, view):
    ball = dataclasses.replace(sphere(0.35, 64), material=2), pose((0.9, -0.6, -0.82))
    scene = _room(ball, (upright((0.8, 0.7), material=3), pose((1.0, 0.6, -0.45), yaw_deg=35.0)))
    sensor = reflective_rooms.camera(120, 2)
    image = frame_of(scene, sensor, VIEWS[view], backend, also=("instance",))
    levels = image.rgba[..., :3] / 255.0
    above = (levels - median_filter(levels, size=(5, 5, 1))).max(axis=-1)
    floor = binary_erosion(image.channels["instance"] == FLOOR, iterations=2)
    assert floor.sum() > 1000
    assert above[floor].max() < 0.25


def test_a_glossy_floor_in_a_mirror_has_as_many_rays_as_the_floor_itself():
    """Measured: 40.7 dB beside many samples; 28.2 dB with one ray a sample in the mirror."""
    mirror = scene_of([upright((0.8, 0.7))], [CHROME])
    at = pose((0.6, 0.2, -0.3), yaw_deg=15.0, pitch_deg=-15.0)
    scene = reflective_rooms.rooms()["floor of roughness 0.3"].added("mirror", mirror, at)
    images = []
    for supersampling in (3, 6):
        sensor = reflective_rooms.camera(64, supersampling)
        with open_sensor(scene, sensor, backend="rays", seed=supersampling) as renderer:
            images.append(renderer.render(reflective_rooms.camera_pose(), also=("instance",)))
    shown = binary_erosion(images[0].channels["instance"] == len(scene.instances))
    assert shown.sum() > 500
    ours, many = (image.rgba[..., :3][shown] for image in images)
    assert psnr_of_levels_db(ours, many) >= 34.0
