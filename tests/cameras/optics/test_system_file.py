"""Optics files: the examples, and the messages of faults."""

import math

import numpy as np
import pytest

from omnisim.cameras.optics import read_optics_file
from omnisim.cameras.optics.profiles import read_profile, sampled, write_profile
from omnisim.cameras.optics.shapes import Conic
from omnisim.cameras.optics.system_file import parse_optics
from omnisim.core.coordinate_frames import (
    BASE_FROM_OPTICAL_LOOKING_AHEAD,
    RIG_FROM_OPTICAL_LOOKING_UP,
)
from omnisim.core.errors import SensorFileError
from tests.cameras.optics.examples import EXAMPLES

CAMERA = {"model": "perspective", "width_px": 360, "height_px": 360, "focal_length_px": 800.0}
SPHERE = {"shape": "sphere", "radius_m": 0.03, "position_m": [0.0, 0.0, 0.15]}


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_examples_see(path):
    system = read_optics_file(path)
    pixels = np.random.default_rng(3).uniform((0, 0), (system.width_px, system.height_px), (500, 2))
    rays = system.rays(pixels)
    assert rays.valid.mean() > 0.3
    found = system.pixel_from_point((rays.origins_m + rays.directions)[rays.valid])
    assert found.valid.all()
    assert np.abs(found.positions_px - pixels[rays.valid]).max() < 1e-8


def test_defaults():
    system = parse_optics({"camera": CAMERA, "surfaces": [SPHERE]})
    assert system.principal_point_px == (179.5, 179.5)
    assert system.surfaces[0].is_mirror
    assert system.surfaces[0].rim_radius_m == math.inf
    np.testing.assert_array_equal(system.rig_from_optical, RIG_FROM_OPTICAL_LOOKING_UP)
    port = {"shape": "plane", "position_m": [0.0, 0.0, 0.1], "medium": "water"}
    window = parse_optics({"camera": CAMERA, "surfaces": [port]})
    np.testing.assert_array_equal(window.rig_from_optical, BASE_FROM_OPTICAL_LOOKING_AHEAD)


def test_misalignment_is_about_the_vertex():
    tilted = SPHERE | {"decenter_m": [0.002, 0.0, 0.0], "tilt_deg": [0.0, 0.0, 90.0]}
    pose = parse_optics({"camera": CAMERA, "surfaces": [tilted]}).surfaces[0].system_from_surface
    np.testing.assert_allclose(pose[:3, 3], (0.002, 0.0, 0.15))
    np.testing.assert_allclose(pose[:3, :3] @ (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), atol=1e-15)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"shape": "ball"}, "surfaces.0.shape: expected "),
        ({"radius_m": "wide"}, "surfaces.0.radius_m: expected "),
        ({"radios_m": 1.0}, "surfaces.0.radios_m: unknown key; did you mean 'radius_m'?"),
        (
            {"hole_raduis_m": 0.01},
            "surfaces.0.hole_raduis_m: unknown key; did you mean 'hole_radius_m'?",
        ),
        ({"position_m": None}, "surfaces.0.position_m: missing"),
        ({"medium": "honey"}, "surfaces.0.medium: expected vacuum, air, water, acrylic, glass, a"),
        ({"shape": "conic", "radius_m": 0.0}, "surfaces.0.radius_m: expected a number of meters"),
        ({"shape": "sphere", "radius_m": 0.0}, "surfaces.0.radius_m: expected a number of meters"),
        ({"shape": "asphere"}, "surfaces.0.rim_radius_m: missing"),
        ({"shape": "dome", "thickness_m": 0.1}, "surfaces.0.medium: missing"),
        (
            {"rim_radius_m": 0.07, "hole_radius_m": 12},
            "surfaces.0.hole_radius_m: expected 0 or more, and less than rim_radius_m = 0.07",
        ),
        (
            {"shape": "dome", "thickness_m": 0.1, "medium": "water"},
            "surfaces.0.thickness_m: expected less than radius_m = 0.03, got 0.1",
        ),
    ],
)
def test_faults_of_surfaces(changes, message):
    table = {key: value for key, value in (SPHERE | changes).items() if value is not None}
    with pytest.raises(SensorFileError) as caught:
        parse_optics({"camera": CAMERA, "surfaces": [table]}, "a.toml")
    assert str(caught.value).startswith(f"a.toml: {message}")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"model": "lens"}, "camera.model: expected one of"),
        ({"focal_length_px": -1.0}, "camera."),
        ({"focus": 1.0}, "camera.focus: unknown key"),
        ({"calibration": "a.yaml"}, "camera.model: calibration has it: expected one of them"),
    ],
)
def test_faults_of_the_camera(changes, message):
    with pytest.raises(SensorFileError) as caught:
        parse_optics({"camera": CAMERA | changes, "surfaces": [SPHERE]}, "a.toml")
    assert str(caught.value).startswith(f"a.toml: {message}")


def test_profile_file(tmp_path):
    path = tmp_path / "profile.csv"
    write_profile(path, *sampled(Conic(0.03), 0.02, 50)[:2])
    profile = read_profile(path)
    radii_m = np.linspace(0.0, 0.02, 333)
    np.testing.assert_allclose(profile.sag_m(radii_m), Conic(0.03).sag_m(radii_m), atol=1e-9)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("r_m,h_m\n0,0\n", "expected the columns r_m,z_m, got r_m,h_m"),
        ("r_m,z_m\n0,0\n1,1\n", "expected at least 4 points, got 2"),
        ("r_m,z_m\n1,0\n2,1\n3,1\n4,1\n", "r_m: expected numbers that grow from 0"),
        ("r_m,z_m\n0,0\n2,1\n2,1\n4,1\n", "r_m: expected numbers that grow from 0"),
        ("r_m,z_m\n0,0\n1,x\n", "'x': expected a number"),
        ("r_m,z_m\n0,0\n1,1\n2,1\n4,1e9\n", "expected finite numbers in meters"),
    ],
)
def test_faults_of_profiles(tmp_path, text, message):
    path = tmp_path / "bad.csv"
    path.write_text(text)
    with pytest.raises(SensorFileError) as caught:
        read_profile(path)
    assert str(caught.value).startswith(str(path))
    assert message in str(caught.value)
