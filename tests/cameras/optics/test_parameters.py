"""Parameters of optical systems: complete, so that files of images and runs need no others."""

import dataclasses
import json

import numpy as np
import pytest

from omnisim.cameras import CAMERA_MODELS
from omnisim.cameras.optics import OpticalSystem, Surface, read_optics_file
from omnisim.cameras.optics.shapes import Conic, Polynomial
from omnisim.cameras.optics.surface import refractive_index
from omnisim.cameras.optics.system_file import parse_optics
from omnisim.core import poses
from omnisim.core.errors import OmnisimError, OpticsError
from omnisim.core.files.sources import fingerprint
from omnisim.rendering.camera.captured_image import camera_of_parameters
from tests.cameras.optics.examples import EXAMPLES, SYSTEMS, pinhole

TILTED = poses.pose((0.01, -0.02, 0.003), roll_deg=0.3, pitch_deg=0.2, yaw_deg=0.1)
ALL = {
    **SYSTEMS,
    **{path.stem: read_optics_file(path) for path in EXAMPLES},
    "every key": dataclasses.replace(
        SYSTEMS["needle"],
        medium=(1.331, 1.333, 1.337),
        color="B",
        origin_m=(0.001, 0.002, 0.1),
        system_from_camera=TILTED,
        orientation=TILTED[:3, :3],
    ),
}
each = pytest.mark.parametrize("system", ALL.values(), ids=ALL)


def _again(system):
    return camera_of_parameters(json.loads(json.dumps(system.parameters())))


@each
def test_round_trip(system):
    again = _again(system)
    assert isinstance(again, OpticalSystem)
    assert again.parameters() == system.parameters()
    pixels = np.random.default_rng(5).uniform((0, 0), (system.width_px, system.height_px), (300, 2))
    for found, expected in zip(again.rays(pixels), system.rays(pixels), strict=True):
        np.testing.assert_array_equal(found, expected)
    np.testing.assert_array_equal(again.rig_from_optical, system.rig_from_optical)
    scaled = again.scaled(0.5)
    assert (scaled.width_px, scaled.height_px) == (system.width_px // 2, system.height_px // 2)


def test_fingerprint_follows_the_profile():
    system = ALL["equi-angular"]
    assert fingerprint(_again(system)) == fingerprint(system)
    table = system.surfaces[0].shape
    heights_m = table.table_heights_m.copy()
    heights_m[7] += 1e-9
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


IDENTITY = np.eye(4).tolist()


def _table(**changes):
    return json.loads(json.dumps(SYSTEMS["sphere"].parameters())) | changes


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"color": "X"}, "color: expected "),
        ({"looking": "back"}, "looking: expected up, ahead, down, or a rotation, a 3 × 3 matrix"),
        ({"looking": [[1, 0, 0], [0, 1, 0], [0, 0, 2]]}, "looking: expected a rotation, got "),
        ({"medium": [1.3, 1.3]}, "medium: expected vacuum, air, water, "),
        ({"camera": {"model": "optics"}}, "camera.model: expected one of "),
        ({"surfaces": [{}]}, "surfaces.0.shape: missing"),
    ],
)
def test_faults(changes, message):
    with pytest.raises(OmnisimError) as caught:
        parse_optics(_table(**changes), "a.toml")
    assert str(caught.value).startswith(f"a.toml: {message}")
    with pytest.raises(OmnisimError) as caught:
        parse_optics(_table(**changes), "a.toml", "optics")
    assert str(caught.value).startswith(f"a.toml: optics.{message}")


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"position_m": [0, 0, 1], "pose": IDENTITY}, "position_m: pose has it: expected one of"),
        ({"pose": [[1, 0, 0, 0]] * 4}, "pose: expected a rotation and a translation"),
        ({"pose": 1}, "pose: expected a pose, a 4 × 4 matrix"),
        ({"shape": "table", "r_m": [0.0, 1.0]}, "z_m: missing; expected file, or r_m and z_m"),
        (
            {"shape": "table", "file": "a.csv", "r_m": [0.0]},
            "r_m: file has it: expected one of them",
        ),
        (
            {"shape": "table", "r_m": [0.0, 1.0, 2.0, 3.0], "z_m": [0.0]},
            "z_m: expected as many numbers as r_m, 4, got 1",
        ),
        (
            {"shape": "table", "r_m": [0.0, 1.0, 1.0, 3.0], "z_m": [0.0, 1.0, 2.0, 3.0]},
            "r_m: expected numbers that grow from 0",
        ),
        ({"hole_radius_m": 0.03}, "hole_radius_m: expected 0 or more, and less than rim_radius_m"),
    ],
)
def test_faults_of_surfaces(changes, message):
    table = _table()
    surface = table["surfaces"][0] | changes
    if "pose" in changes and "position_m" not in changes:
        del surface["position_m"]
    if surface["shape"] == "table":
        del surface["radius_m"], surface["conic"]
    with pytest.raises(OmnisimError) as caught:
        parse_optics(table | {"surfaces": [surface]}, "a.toml")
    assert message in str(caught.value)
    assert str(caught.value).startswith("a.toml: surfaces.0")
    assert "\n" not in str(caught.value)


def test_faults_of_systems():
    mirror = Surface(Conic(0.03), poses.pose((0.0, 0.0, 0.15)))
    with pytest.raises(OpticsError, match="camera: expected a central camera"):
        OpticalSystem(SYSTEMS["sphere"], (mirror,))
    with pytest.raises(OmnisimError, match="expected a rotation"):
        OpticalSystem(pinhole(800.0), (mirror,), orientation=2.0 * np.eye(3))
    with pytest.raises(OpticsError, match="surface: rim_radius_m: missing"):
        Surface(Polynomial((0.0, 16.0)))


def test_a_camera_without_a_principal_point_has_none_by_default():
    models = {name for name, kind in CAMERA_MODELS.items()
              if "principal_point_px" not in kind.__dataclass_fields__}  # fmt: skip
    assert models
    port = {"shape": "dome", "radius_m": 1.0, "thickness_m": 0.1, "position_m": [0, 0, 0],
            "medium": "water"}  # fmt: skip
    camera = {"model": "equirectangular", "width_px": 40, "height_px": 20}
    assert parse_optics({"camera": camera, "surfaces": [port]}).width_px == 40


@pytest.mark.parametrize(
    "table", [{"camera": {"calibration": "a.yaml"}}, {"surfaces": [{"file": "../a.csv"}]}]
)
def test_images_name_no_other_files(table):
    with pytest.raises(
        OpticsError, match=r"^camera: (calibration|file): expected its content, got"
    ):
        camera_of_parameters(_table(**table))
    with pytest.raises(OpticsError, match=r"^[^\n]*$"):
        camera_of_parameters({"model": "optics", "surfaces": 1})
