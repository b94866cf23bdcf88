"""Optical systems in a real scene, which the validation does not have."""

import pytest

from omnisim.scene import load_scene
from omnisim.validation.checks.optics import measure_triangles, triangle_section
from omnisim.validation.fixture import Fixture
from omnisim.validation.optical_systems import validation_systems
from omnisim.validation.oracles.surfaces import opaque_only
from tests.scenes import with_warehouse

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("needs_opengl")]


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
