"""Lit scenes of the validation, and baked light of windows and shining surfaces."""

import numpy as np
import pytest

from omnisim.core.poses import pose
from omnisim.rendering.baking.settings import BakeSettings
from omnisim.rendering.stage import open_sensor
from omnisim.scene import load_scene
from omnisim.scene.model import Lighting, LightKind, Material
from omnisim.validation.fixture import linear_image
from omnisim.validation.image_differences import psnr_db, ssim
from omnisim.validation.reflective_rooms import window_room
from omnisim.validation.traced_light import fisheye, inside_rim, small_mirror, traced_light
from tests.scenes import room, scene_of, square

for package in ("mitsuba", "embreex", "xatlas"):
    pytest.importorskip(package)

from omnisim.rendering.baking import transport  # noqa: E402
from omnisim.validation.checks.lit_scenes import (  # noqa: E402
    BAKED_BOUND_DB,
    BOUND_SSIM,
    FOLDER,
    in_baked_light,
)

LIT = {
    "soccer": ([LightKind.POINT, LightKind.POINT], 0.001),
    "courtyard": ([LightKind.POINT, LightKind.DIRECTIONAL], 1e-5),
}
BLOCK_PX = 4  # averaged, since Mitsuba's noise is 10 dB above the difference


@pytest.mark.parametrize("name", LIT)
def test_light_is_that_of_the_lamps(name):
    """Whatever the built-in scenes have."""
    scene = load_scene(FOLDER / f"{name}.toml")
    kinds, exposure = LIT[name]
    lighting = scene.lighting
    assert [light.kind for light in lighting.lights] == kinds
    assert all(light.casts_shadow for light in lighting.lights)
    assert (lighting.ambient, lighting.exposure) == ((0.0, 0.0, 0.0), exposure)
    assert (lighting.environment, lighting.baked, lighting.fog) == (None, None, None)
    assert scene.background == (0.0, 0.0, 0.0)
    assert not scene.objects


def _rendered(scene, sensor, at, backend="cube"):
    with open_sensor(scene, sensor, backend=backend) as renderer:
        return linear_image(renderer.render(at, linear=True))


@pytest.mark.slow
@pytest.mark.usefixtures("needs_opengl")
def test_light_of_a_panel():
    """With soft shadows, and colors that bounce between the walls; measured: 40.8 dB and 0.989."""
    meshes = [room(), square(0.6, material=1, name="panel"), square(0.7, material=2, name="table")]
    poses = [np.eye(4), pose((0.8, 0.4, 1.4), roll_deg=180.0), pose((0.3, 0.2, -0.7))]
    materials = [
        Material(double_sided=True),
        Material("panel", (0.5, 0.5, 0.5, 1.0), emissive=(9.0, 8.0, 6.5)),  # faces down
        Material(base_color=(0.6, 0.3, 0.2, 1.0), double_sided=True),
    ]
    scene = scene_of(meshes, materials, poses, Lighting((0.0, 0.0, 0.0), (), exposure=1.0))
    sensor = fisheye(64)
    at, inside = sensor.base_pose((-2.0, -1.0, -0.6), yaw_deg=25.0), inside_rim(sensor)
    ours = _rendered(in_baked_light(scene, BakeSettings(texel_m=0.12, samples=64)), sensor, at)
    traced = traced_light(scene, sensor, at, 16, bounces=True)
    assert psnr_db(traced, ours, inside) > BAKED_BOUND_DB
    assert ssim(traced, ours, inside) > BOUND_SSIM


@pytest.mark.slow
@pytest.mark.usefixtures("needs_opengl")
@pytest.mark.long
def test_light_by_window_mirror_and_frosted_glass_is_a_path_tracers(monkeypatch):
    """Measured: 40.2 dB by rays and 39.6 dB by cube, at 400 paths per pixel."""
    scene, sensor = window_room(), small_mirror(32)
    at, inside = sensor.base_pose(scene.start.position_m, yaw_deg=20.0), inside_rim(sensor)

    def blocks(image):
        image = np.where(inside[..., None], np.clip(image, 0.0, 1.0), 0.0)
        size = len(image) // BLOCK_PX
        return image.reshape(size, BLOCK_PX, size, BLOCK_PX, 3).mean(axis=(1, 3))

    def baked_db(texel_m, backend):
        lit = in_baked_light(scene, BakeSettings(texel_m=texel_m, samples=32))
        ours = blocks(_rendered(lit, sensor, at, backend))
        return psnr_db(traced, ours, np.ones(ours.shape[:2], dtype=bool))

    traced = blocks(traced_light(scene, sensor, at, 256, bounces=True))
    assert min(baked_db(0.2, backend) for backend in ("rays", "cube")) >= BAKED_BOUND_DB
    monkeypatch.setattr(transport, "MAX_SPECULAR", 0)  # opaque glass and black mirrors
    assert baked_db(0.4, "cube") < BAKED_BOUND_DB - 10.0
