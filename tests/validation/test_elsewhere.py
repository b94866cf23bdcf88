"""The validation in other scenes than its own: a real warehouse, and `soccer`."""

import dataclasses

import numpy as np
import pytest

from omnisim.rendering.baking.settings import BakeSettings
from omnisim.rendering.stage import open_sensor
from omnisim.scene import load_scene
from omnisim.scene.model import Light, Lighting, LightKind
from omnisim.validation.checks.optics import measure_triangles, triangle_section
from omnisim.validation.checks.other_renderers import measure_quality
from omnisim.validation.fixture import Fixture, linear_image
from omnisim.validation.image_differences import psnr_db, ssim
from omnisim.validation.optical_systems import validation_systems
from omnisim.validation.oracles.surfaces import opaque_only
from omnisim.validation.traced_light import fisheye, inside_rim, traced_light
from tests.scenes import with_warehouse

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("needs_opengl")]


@with_warehouse("soccer", long=True)
def test_default_quality(source):
    # measured: 40.6 dB and 0.325 in soccer, 41.0 dB and 0.301 in the warehouse
    section = measure_quality(Fixture(is_quick=True), load_scene(source), (1.0, -2.0, 1.2), "")
    assert section.missed == []


@with_warehouse(long=True)
def test_pixels_show_the_triangles_of_their_rays(source):
    pytest.importorskip("embreex", reason="embreex, which casts the rays, is missing")
    found = measure_triangles(Fixture(), load_scene(source))
    shares = {("warehouse", system): share for system, share in found.items()}
    assert triangle_section("", shares).missed == []


@with_warehouse(long=True)
@pytest.mark.parametrize("name", ["sphere", "flat port"])
def test_images_are_those_of_real_optics(source, name):
    pytest.importorskip("mitsuba", reason="Mitsuba is an optional oracle")
    from omnisim.validation.checks.optics_images import BOUND_DB, TracedSystem

    scene = opaque_only(load_scene(source))
    traced = TracedSystem(Fixture(), validation_systems()[name], scene.start.position_m)
    assert traced.compare(scene).decibels > BOUND_DB


@with_warehouse(long=True)
def test_shadows_and_a_draft_of_baked_light_are_a_path_tracers(source):
    """Measured: 40.2 dB with 256 rays a pixel; baked: 37.6 dB and 0.983."""
    for package in ("mitsuba", "embreex", "xatlas"):
        pytest.importorskip(package)
    from omnisim.validation.checks import lit_scenes
    from omnisim.validation.oracles.mitsuba_light import matte_on_both_sides

    lamps = [
        Light(LightKind.POINT, (1, 1, 1), 9.0, position_m=np.array(place))
        for place in ((2.0, 5.0, 5.0), (-2.0, -4.0, 5.0))
    ]
    lighting = Lighting((0.0, 0.0, 0.0), tuple(lamps), exposure=1.0)
    hall = dataclasses.replace(load_scene(source), lighting=lighting, background=(0.0, 0.0, 0.0))
    scene, sensor = matte_on_both_sides(hall), fisheye(96)
    at, inside = sensor.base_pose((1.0, -2.0, 1.2), yaw_deg=60.0), inside_rim(sensor)

    def ours(scene):
        with open_sensor(scene, sensor) as renderer:
            return linear_image(renderer.render(at, linear=True))

    traced = traced_light(scene, sensor, at, 9)
    assert psnr_db(traced, ours(scene), inside) > lit_scenes.BOUND_DB
    baked = ours(lit_scenes.in_baked_light(scene, BakeSettings(texel_m=0.15, samples=32)))
    traced = traced_light(scene, sensor, at, 16, bounces=True)
    assert psnr_db(traced, baked, inside) > lit_scenes.BAKED_BOUND_DB
    assert ssim(traced, baked, inside) > lit_scenes.BOUND_SSIM
