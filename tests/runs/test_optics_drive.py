"""Drives with optical systems: their folders hold all of them, and go on with the same bytes."""

import dataclasses
import json
import shutil

import numpy as np
import pytest
import trimesh

from omnisim import OmniCamera
from omnisim.cameras.optics import CentralView
from omnisim.core.errors import RobotFileError, RunError
from omnisim.core.files.image_files import read_image
from omnisim.perception.unwarping import Panorama
from omnisim.rendering.camera.captured_image import read_captured_image
from omnisim.rendering.camera.degradations import preset
from omnisim.rendering.camera.omnicamera import CALIBRATION
from omnisim.robots.vehicle import Vehicle
from omnisim.runs.drive import Drive
from omnisim.runs.route import Route
from omnisim.runs.run_data import read_run
from omnisim.runs.run_manifest import first_difference
from omnisim.scene import load_scene
from omnisim.sensors.calibration_file import read_mount
from tests.cameras.optics.examples import ALL, EXAMPLES

EQUI_ANGULAR = next(path for path in EXAMPLES if path.stem == "equi-angular")
ROUTE = Route("lap", step_m=4.0, step_deg=90.0)
ROBOT = """
name = "balls"
[kinematics]
type = "differential"
track_m = 0.4
wheel_diameter_m = 0.2
max_speed_mps = 1.0
max_turn_rate_degps = 300.0
max_acceleration_mps2 = 0.5
max_turn_acceleration_degps2 = 300.0
[[sensors]]
name = "optics"
type = "omnicamera"
file = "sensor.toml"
position_m = [0.1, 0.0, 0.5]
"""
SENSOR = """
[optics]
file = "equi-angular.toml"
[optics.mounting]
yaw_deg = 30.0
"""


@pytest.fixture(scope="module")
def scene():
    return load_scene("soccer")


def _vehicle(folder, bump_m=0.0):
    """Robot whose mirror's profile is beside it, a bump of it in its middle."""
    folder.mkdir()
    shutil.copy(EQUI_ANGULAR, folder)
    lines = EQUI_ANGULAR.with_suffix(".csv").read_text().splitlines()
    radius, height = lines[200].split(",")
    lines[200] = f"{radius},{float(height) + bump_m!r}"
    (folder / "equi-angular.csv").write_text("\n".join(lines) + "\n")
    (folder / "robot.toml").write_text(ROBOT)
    (folder / "sensor.toml").write_text(SENSOR)
    degradation = preset("dragonfly2")  # metered, with a shutter and noise
    loaded = Vehicle.load(folder / "robot.toml").with_cameras(size_px=40, quality="fast")
    return loaded.with_cameras(degradation=degradation.scaled(40 / 360))


@pytest.fixture(scope="module")
def runs(tmp_path_factory, scene):
    from tests.conftest import open_context_or_skip

    open_context_or_skip().release()
    pytest.importorskip("embreex", reason="embreex, which finds ground truth, is missing")
    folder = tmp_path_factory.mktemp("runs")
    vehicle = _vehicle(folder / "robot")
    list(Drive(scene, vehicle, ROUTE, seed=3, channels=("range",)).plan().record(folder / "whole"))
    return folder


def test_what_is_missing_comes_back_with_the_same_bytes(runs, scene, tmp_path):
    run, vehicle = tmp_path / "run", _vehicle(tmp_path / "robot")
    shutil.copytree(runs / "whole", run)
    kept = {path: path.read_bytes() for path in run.rglob("*") if path.is_file()}
    names = ("000001.png", "000002.channels.exr", CALIBRATION, "sensor.toml")
    for name in names:
        (run / "optics" / name).unlink()
    list(Drive(scene, vehicle, ROUTE, seed=3, channels=("range",)).plan().record(run))
    assert {path: path.read_bytes() for path in kept} == kept


def test_another_profile_is_another_run(runs, scene, tmp_path):
    vehicle = _vehicle(tmp_path / "robot", bump_m=1e-9)
    plan = Drive(scene, vehicle, ROUTE, seed=3, channels=("range",)).plan()
    with pytest.raises(RunError, match=r"optics\.optics\.surfaces\.0\.z_m\.199 was ") as fault:
        list(plan.record(runs / "whole"))
    assert len(str(fault.value)) < 600


def test_the_folder_holds_the_system(runs, scene, tmp_path):
    """Without the robot's files, its camera is read back from each of the run's."""
    whole = runs / "whole"
    expected = _vehicle(tmp_path / "robot").camera().sensor
    parameters = expected.model.parameters()
    manifest = json.loads((whole / "manifest.json").read_text())
    assert manifest["sensors"]["optics"]["optics"] == json.loads(json.dumps(parameters))
    for read in (
        read_mount(whole / "optics" / CALIBRATION).camera,
        read_captured_image(whole / "optics" / "000000.png").camera,
        OmniCamera.from_file(whole / "optics" / "sensor.toml").model,
    ):
        assert read.parameters() == parameters
    again = OmniCamera.from_file(whole / "optics" / "sensor.toml")
    np.testing.assert_allclose(again.base_from_rig, expected.base_from_rig, atol=1e-12)
    assert read_image(whole / "optics" / "000001.png")[1]["degradation"]["sub_frames"] >= 1


def test_localization_says_that_it_assumes_a_viewpoint(runs):
    """Landmarks are sought from the point nearest to all rays, and its error is told."""
    data = read_run(runs / "whole")
    mount = read_mount(runs / "whole" / "optics" / CALIBRATION)
    assert isinstance(data.mount.camera, CentralView)
    above_m = mount.base_from_optical[:3, :3] @ data.mount.camera.viewpoint_m
    np.testing.assert_allclose(
        data.mount.base_from_optical[:3, 3], mount.base_from_optical[:3, 3] + above_m
    )
    caveat = data.notices[-1]
    assert caveat.startswith("optics: rays meet in no point: one is assumed, right for points at")
    assert " px at 5 m (99 % of the image)" in caveat
    assert Panorama(data.mount)(data.image(0)).max() > 0


def test_sensor_file(tmp_path):
    """Written in place, a system is the same to the last bit, with names that TOML escapes."""
    sphere = ALL["sphere"]
    surface = dataclasses.replace(sphere.surfaces[0], name='a"\\\x7f\U0001f600\x01.')
    for system in (*ALL.values(), dataclasses.replace(sphere, surfaces=(surface,))):
        (tmp_path / "sensor.toml").write_text(OmniCamera(system).to_toml(), encoding="utf-8")
        again = OmniCamera.from_file(tmp_path / "sensor.toml")
        assert again.model.parameters() == system.parameters()
        assert again.model.surfaces[0].name == system.surfaces[0].name


def test_differences_of_long_lists_are_named_by_number():
    values = [float(number) for number in range(100)]
    other = [*values[:40], -1.0, *values[41:]]
    assert first_difference({"a": values}, {"a": other}) == "a.40 was 40.0, is -1.0"
    assert first_difference({"a": values}, {"a": values[:-1]}) == "a.99 was 99.0, is None"
    assert first_difference({"a": [1, 2]}, {"a": [1]}) == "a was [1, 2], is [1]"
    assert first_difference({"a": [{"b": 1}]}, {"a": [{"b": 2}]}) == "a.0.b was 1, is 2"


def test_a_pinhole_in_its_housing_sees_by_the_mirror_above(tmp_path):
    """A body that has the pinhole in it, but not the mirror, hides nothing."""
    (tmp_path / "robot.toml").write_text(
        'name = "ball"\nbody = "box.glb"\n[[sensors]]\nname = "ball"\ntype = "omnicamera"\n'
        'file = "sphere.toml"\nposition_m = [0.0, 0.0, 0.5]\n'
    )
    sphere = next(path for path in EXAMPLES if path.stem == "sphere")
    shutil.copy(sphere, tmp_path)
    housing = trimesh.creation.box((0.2, 0.2, 0.2))
    housing.apply_translation((0.0, 0.5, 0.0))  # y is up in glTF
    housing.export(tmp_path / "box.glb")
    found = Vehicle.load(tmp_path / "robot.toml").cameras[0].origin_m
    np.testing.assert_allclose(found, (0.0, 0.0, 0.5 + 0.1557), atol=1e-3)
    near = sphere.read_text().replace("0.15]", "0.08]")
    (tmp_path / "sphere.toml").write_text(near)
    with pytest.raises(RobotFileError, match=r"its effective viewpoint .* is inside the body's"):
        Vehicle.load(tmp_path / "robot.toml")
