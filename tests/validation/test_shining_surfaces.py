"""Baked light of surfaces that shine, against a path tracer's through a fisheye."""

import dataclasses

import numpy as np
import pytest

from omnisim.core.poses import pose
from omnisim.rendering.baking.settings import BakeSettings
from omnisim.rendering.stage import open_sensor
from omnisim.scene.model import Lighting, Material
from omnisim.validation.fixture import linear_image
from omnisim.validation.image_differences import psnr_db, ssim
from omnisim.validation.traced_light import fisheye, inside_rim, traced_light
from tests.scenes import room, scene_of, square

pytestmark = [pytest.mark.usefixtures("needs_opengl"), pytest.mark.slow]
for package in ("mitsuba", "embreex", "xatlas"):
    pytest.importorskip(package)

from omnisim.validation.checks.lit_scenes import BAKED_BOUND_DB, BOUND_SSIM, in_baked_light  # noqa: E402
from omnisim.validation.oracles.mitsuba_light import matte_on_both_sides  # noqa: E402

SENSOR = fisheye(64)
AT = SENSOR.base_pose((-2.0, -1.0, -0.6), yaw_deg=25.0)
PANEL = Material("panel", (0.5, 0.5, 0.5, 1.0), emissive=(9.0, 8.0, 6.5))


def matte_and_shining(scene):
    """Scene of `matte_on_both_sides` whose bright surfaces shine, to their front alone."""
    matte = matte_on_both_sides(scene)
    materials = []
    for plain, one in zip(matte.materials, scene.materials, strict=True):
        shines = any(one.emissive) and not one.unlit
        material = Material(
            one.name,
            plain.base_color,
            plain.texture,
            plain.alpha_mode,
            plain.alpha_cutoff,
            double_sided=not shines,
            emissive=one.emissive if shines else (0.0, 0.0, 0.0),
            emissive_map=one.emissive_map if shines else None,
        )
        materials.append(material)
    lighting = dataclasses.replace(matte.lighting, is_matte=False)
    return dataclasses.replace(matte, materials=tuple(materials), lighting=lighting)


@pytest.fixture(scope="module")
def scene():
    """A room under a panel that faces down, with a table below it."""
    panel, table = square(0.6, material=1, name="panel"), square(0.7, material=2, name="table")
    meshes = [room(), panel, table]
    poses = [np.eye(4), pose((0.8, 0.4, 1.4), roll_deg=180.0), pose((0.3, 0.2, -0.7))]
    materials = [Material(), PANEL, Material(base_color=(0.6, 0.3, 0.2, 1.0))]
    lighting = Lighting((0.0, 0.0, 0.0), (), exposure=1.0)
    return matte_and_shining(scene_of(meshes, materials, poses, lighting))


def test_light_of_a_panel(scene):
    """With soft shadows, and colors that bounce between the walls; measured: 40.8 dB and 0.989."""
    lit = in_baked_light(scene, BakeSettings(texel_m=0.12, samples=64))
    with open_sensor(lit, SENSOR) as renderer:
        ours = linear_image(renderer.render(AT, linear=True))
    traced, inside = traced_light(scene, SENSOR, AT, 16, bounces=True), inside_rim(SENSOR)
    assert psnr_db(traced, ours, inside) > BAKED_BOUND_DB
    assert ssim(traced, ours, inside) > BOUND_SSIM
