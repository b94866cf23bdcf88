"""Mitsuba's rays through real mirrors and windows against ours, which know no mesh."""

import dataclasses

import numpy as np
import pytest

from omnisim.cameras import pixel_grid
from omnisim.cameras.optics.shapes import Cone
from omnisim.core.coordinate_frames import RIG_FROM_OPTICAL_LOOKING_UP
from omnisim.core.errors import OpticsError
from omnisim.core.poses import pose
from omnisim.validation.optical_systems import validation_systems
from omnisim.validation.plain_scenes import marker_pixels, markers_on_rays
from tests.cameras.optics.examples import SYSTEMS
from tests.scenes import room, room_color, room_hit, scene_of
from tests.slow import slow_but

pytest.importorskip("mitsuba", reason="Mitsuba is an optional oracle")
from omnisim.validation.oracles.mitsuba_optics import PhysicalOptics

POSE = pose((0.4, -0.3, 0.2), roll_deg=25.0, pitch_deg=-70.0, yaw_deg=35.0)
POSE[:3, :3] = POSE[:3, :3] @ RIG_FROM_OPTICAL_LOOKING_UP
# Facets, float32, and the distance at which Mitsuba begins a ray: a tenth of a marker's bound.
BOUND_PX = 0.005


@pytest.mark.parametrize("name", slow_but(validation_systems(), "flat port"))
def test_single_rays(name):
    system = validation_systems()[name]
    pixels = np.random.default_rng(0).uniform((10.0, 10.0), (349.0, 349.0), (120, 2))
    pixels = pixels[system.rays(pixels).valid]
    origins_m, directions = PhysicalOptics(system, POSE).rays(pixels)
    assert len(pixels) > 50
    seen = system.pixel_from_point(origins_m + directions)
    assert np.linalg.norm(seen.positions_px - pixels, axis=1).max() < BOUND_PX


@pytest.mark.slow
@pytest.mark.parametrize("name", ["sphere", "flat port", "dome port"])
def test_room_of_gradients(name):
    """Reflected light is lost, and darkens nothing."""
    system = validation_systems()[name].scaled(0.2)
    traced = PhysicalOptics(system, POSE).image(scene_of([room()]), 64)
    steps = (np.arange(4) + 0.5) / 4.0 - 0.5
    inside, total = np.ones(traced.shape[:2], dtype=bool), 0.0
    for right in steps:
        for down in steps:
            rays = system.rays(pixel_grid(72, 72) + (right, down))
            origins = rays.origins_m @ POSE[:3, :3].T + POSE[:3, 3]
            total = total + room_color(room_hit(origins, rays.directions @ POSE[:3, :3].T)) / 16.0
            inside &= rays.valid
    difference = np.abs(traced - total)[inside]
    assert inside.mean() > 0.4
    assert difference.mean() < 0.05 / 255.0
    assert np.percentile(difference, 99.5) < 1.0 / 255.0


def test_other_cameras_windows_and_rims_are_refused():
    with pytest.raises(OpticsError, match="camera: expected a pinhole, got 'equidistant'"):
        PhysicalOptics(SYSTEMS["dome"], POSE)
    for name, change, message in (
        ("flat port", {"shape": Cone(50.0)}, "expected a window's plane or whole sphere"),
        ("sphere", {"rim_center_m": (0.001, 0.0)}, "sphere: expected a rim about the axis"),
    ):
        system = validation_systems()[name]
        first, *others = system.surfaces
        surfaces = (dataclasses.replace(first, **change), *others)
        optics = PhysicalOptics(dataclasses.replace(system, surfaces=surfaces), POSE)
        with pytest.raises(OpticsError, match=message):
            optics.rays(np.array([[180.0, 180.0]]))


def test_markers_are_where_their_rays_go():
    system = validation_systems()["sphere"]
    pixels = marker_pixels(system, 60)
    scene = markers_on_rays(system, pixels, POSE)
    middles_m = (scene.meshes[0].positions[: len(pixels)] - POSE[:3, 3]) @ POSE[:3, :3]
    assert len(pixels) > 10
    seen = system.pixel_from_point(middles_m.astype(np.float64)).positions_px
    assert np.abs(seen - pixels).max() < 1e-3
