"""Optics files and parameters: complete, read back the same, and with messages of faults."""

import dataclasses
import json
import math

import numpy as np
import pytest

from omnisim.cameras import CAMERA_MODELS
from omnisim.cameras.optics import OpticalSystem, Surface, read_optics_file
from omnisim.cameras.optics.profiles import read_profile, sampled, write_profile
from omnisim.cameras.optics.shapes import Conic, Polynomial
from omnisim.cameras.optics.surface import refractive_index
from omnisim.cameras.optics.system_file import parse_optics
from omnisim.core import poses
from omnisim.core.coordinate_frames import (
    BASE_FROM_OPTICAL_LOOKING_AHEAD,
    RIG_FROM_OPTICAL_LOOKING_UP,
)
from omnisim.core.errors import OmnisimError, OpticsError, SensorFileError
from omnisim.core.files.sources import fingerprint
from omnisim.rendering.camera.captured_image import camera_of_parameters
from tests.cameras.optics.examples import ALL, EXAMPLES, SYSTEMS, pinhole

CAMERA = {"model": "perspective", "width_px": 360, "height_px": 360, "focal_length_px": 800.0}
SPHERE = {"shape": "sphere", "radius_m": 0.03, "position_m": [0.0, 0.0, 0.15]}
IDENTITY = np.eye(4).tolist()


def _message(table, at=""):
    with pytest.raises(OmnisimError) as caught:
        parse_optics(table, "a.toml", at)
    assert "\n" not in str(caught.value)
    return str(caught.value)


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_examples_see(path):
    system = read_optics_file(path)
    pixels = np.random.default_rng(3).uniform((0, 0), (system.width_px, system.height_px), (200, 2))
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
    models = {name for name, kind in CAMERA_MODELS.items()
              if "principal_point_px" not in kind.__dataclass_fields__}  # fmt: skip
    assert models == {"equirectangular"}
    camera = {"model": "equirectangular", "width_px": 40, "height_px": 20}
    assert parse_optics({"camera": camera, "surfaces": [port]}).width_px == 40


def test_misalignment_is_about_the_vertex():
    tilted = SPHERE | {"decenter_m": [0.002, 0.0, 0.0], "tilt_deg": [0.0, 0.0, 90.0]}
    pose = parse_optics({"camera": CAMERA, "surfaces": [tilted]}).surfaces[0].system_from_surface
    np.testing.assert_allclose(pose[:3, 3], (0.002, 0.0, 0.15))
    np.testing.assert_allclose(pose[:3, :3] @ (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), atol=1e-15)


@pytest.mark.parametrize("system", ALL.values(), ids=ALL)
def test_parameters_round_trip(system):
    again = camera_of_parameters(json.loads(json.dumps(system.parameters())))
    assert isinstance(again, OpticalSystem)
    assert again.parameters() == system.parameters()
    pixels = np.random.default_rng(5).uniform((0, 0), (system.width_px, system.height_px), (100, 2))
    for found, expected in zip(again.rays(pixels), system.rays(pixels), strict=True):
        np.testing.assert_array_equal(found, expected)
    np.testing.assert_array_equal(again.rig_from_optical, system.rig_from_optical)
    scaled = again.scaled(0.5)
    assert (scaled.width_px, scaled.height_px) == (system.width_px // 2, system.height_px // 2)


def test_fingerprint_follows_the_profile():
    system = ALL["equi-angular"]
    assert fingerprint(camera_of_parameters(system.parameters())) == fingerprint(system)
    table = system.surfaces[0].shape
    heights_m = table.table_heights_m + 1e-9 * (np.arange(len(table.radii_m)) == 7)
    other = dataclasses.replace(table, table_heights_m=heights_m)
    surface = dataclasses.replace(system.surfaces[0], shape=other)
    changed = dataclasses.replace(system, surfaces=(surface,))
    assert fingerprint(changed) != fingerprint(system)


def test_indices_of_three_colors():
    medium = (1.331, 1.333, 1.337)
    assert [refractive_index(medium, color) for color in (None, *"RGB")] == [1.333, *medium]
    with pytest.raises(OpticsError, match="expected indices of R, G and B, got 2"):
        refractive_index((1.3, 1.4))
    with pytest.raises(OpticsError, match=r"expected an index of 1 to 5, got 0\.5"):
        refractive_index((1.3, 0.5, 1.3))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"shape": "ball"}, "shape: expected "),
        ({"radius_m": "wide"}, "radius_m: expected "),
        ({"radios_m": 1.0}, "radios_m: unknown key; did you mean 'radius_m'?"),
        ({"hole_raduis_m": 0.1}, "hole_raduis_m: unknown key; did you mean 'hole_radius_m'?"),
        ({"position_m": None}, "position_m: missing"),
        ({"medium": "honey"}, "medium: expected vacuum, air, water, acrylic, glass, a"),
        ({"shape": "conic", "radius_m": 0.0}, "radius_m: expected a number of meters"),
        ({"radius_m": 0.0}, "radius_m: expected a number of meters"),
        ({"shape": "asphere"}, "rim_radius_m: missing"),
        ({"shape": "dome", "thickness_m": 0.1}, "medium: missing"),
        ({"rim_radius_m": 0.07, "hole_radius_m": 12},
         "hole_radius_m: expected 0 or more, and less than rim_radius_m = 0.07"),
        ({"shape": "dome", "thickness_m": 0.1, "medium": "water"},
         "thickness_m: expected less than radius_m = 0.03, got 0.1"),
        ({"pose": IDENTITY}, "position_m: expected none with pose"),
        ({"pose": [[1, 0, 0, 0]] * 4, "position_m": None},
         "pose: expected a rotation and a translation"),
        ({"pose": 1, "position_m": None}, "pose: expected a pose, a 4 × 4 matrix"),
        ({"r_m": [0.0, 1.0]}, "z_m: missing; expected file, or r_m and z_m"),
        ({"file": "a.csv", "r_m": [0.0]}, "r_m: expected none with file, which states it"),
        ({"r_m": [0.0, 1.0, 2.0, 3.0], "z_m": [0.0]},
         "z_m: expected as many numbers as r_m, 4, got 1"),
        ({"r_m": [0.0, 1.0, 1.0, 3.0], "z_m": [0.0, 1.0, 2.0, 3.0]},
         "r_m: expected numbers that grow from 0"),
    ],
)  # fmt: skip
def test_faults_of_surfaces(changes, message):
    if "r_m" in changes:
        changes = {"shape": "table", "radius_m": None, **changes}
    table = {key: value for key, value in (SPHERE | changes).items() if value is not None}
    found = _message({"camera": CAMERA, "surfaces": [table]})
    assert found.startswith("a.toml: surfaces.0")
    assert message in found


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"model": "lens"}, "camera.model: expected one of"),
        ({"model": "optics"}, "camera.model: expected one of"),
        ({"focal_length_px": -1.0}, "camera."),
        ({"focus": 1.0}, "camera.focus: unknown key"),
        ({"calibration": "a.yaml"}, "camera.model: expected none with calibration"),
    ],
)
def test_faults_of_the_camera(changes, message):
    found = _message({"camera": CAMERA | changes, "surfaces": [SPHERE]})
    assert found.startswith(f"a.toml: {message}")


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"color": "X"}, "color: expected "),
        ({"looking": "back"}, "looking: expected up, ahead, down, or a rotation, a 3 × 3 matrix"),
        ({"looking": [[1, 0, 0], [0, 1, 0], [0, 0, 2]]}, "looking: expected a rotation, got "),
        ({"medium": [1.3, 1.3]}, "medium: expected vacuum, air, water, "),
        ({"surfaces": [{}]}, "surfaces.0.shape: missing"),
    ],
)
def test_faults_of_files(changes, message):
    table = {"camera": CAMERA, "surfaces": [SPHERE], **changes}
    assert _message(table).startswith(f"a.toml: {message}")
    assert _message(table, "optics").startswith(f"a.toml: optics.{message}")


def test_faults_of_systems():
    mirror = Surface(Conic(0.03), poses.pose((0.0, 0.0, 0.15)))
    with pytest.raises(OpticsError, match="camera: expected a central camera"):
        OpticalSystem(SYSTEMS["sphere"], (mirror,))
    with pytest.raises(OmnisimError, match="expected a rotation"):
        OpticalSystem(pinhole(800.0), (mirror,), orientation=2.0 * np.eye(3))
    with pytest.raises(OpticsError, match="surface: rim_radius_m: missing"):
        Surface(Polynomial((0.0, 16.0)))


@pytest.mark.parametrize(
    "table", [{"camera": {"calibration": "a.yaml"}}, {"surfaces": [{"file": "../a.csv"}]}]
)
def test_images_name_no_other_files(table):
    parameters = SYSTEMS["sphere"].parameters()
    with pytest.raises(OpticsError, match=r"^camera: (calibration|file): expected its content"):
        camera_of_parameters(parameters | table)
    with pytest.raises(OpticsError, match=r"^[^\n]*$"):
        camera_of_parameters({"model": "optics", "surfaces": 1})


def test_profile_file(tmp_path):
    path = tmp_path / "profile.csv"
    write_profile(path, *sampled(Conic(0.03), 0.02, 50)[:2])
    radii_m = np.linspace(0.0, 0.02, 333)
    expected_m = Conic(0.03).sag_m(radii_m)
    np.testing.assert_allclose(read_profile(path).sag_m(radii_m), expected_m, atol=1e-9)


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
