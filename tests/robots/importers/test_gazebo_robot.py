"""Robots out of Gazebo's models."""

import math
from pathlib import Path

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from omnisim.cameras import EquidistantCamera, PerspectiveCamera
from omnisim.core.errors import RobotFileError
from omnisim.robots.importers.gazebo_robot import import_model
from omnisim.robots.importers.importers import load_robot_model
from omnisim.robots.vehicle import Vehicle
from tests.scene.formats.sdf.worlds import BOX, model, sdf, visual, world

ROVER = Path(__file__).parents[3] / "examples" / "gazebo" / "models" / "rover" / "model.sdf"


def load(path, folder, **options):
    """Vehicle of the imported robot file, and what was imported."""
    output = folder / "robot.toml"
    imported = import_model(path, **options)
    imported.write(output)
    return Vehicle.load(output), imported


def sensor(kind, inner, name="s", rest=""):
    return f'<sensor name="{name}" type="{kind}">{rest}{inner}</sensor>'


def load_sensors(tmp_path, *texts, version="1.9"):
    (tmp_path / "a.sdf").write_text(sdf(model("m", visual(BOX) + "".join(texts)), version))
    return load(tmp_path / "a.sdf", tmp_path)


def test_the_example_has_its_sensors_wheels_and_body(tmp_path):
    vehicle, imported = load(ROVER, tmp_path)
    camera, scanner, imu = vehicle.sensors
    assert isinstance(camera.sensor.model, EquidistantCamera)
    assert camera.sensor.model.focal_length_px == pytest.approx(160 / (0.5 * math.pi), rel=1e-5)
    assert camera.origin_m == pytest.approx((0.2, 0.0, 0.4))
    assert (scanner.sensor.beams, scanner.sensor.range_max_m) == (181, 8.0)
    assert imu.sensor.rate_hz == 100.0
    assert vehicle.kinematics.max_speed_mps == 0.8
    assert vehicle.body.instance_names[0] == "rover/chassis/box"
    assert imported.kinematics["track_m"] == 0.36


def test_the_robot_without_files_is_that_of_its_files(tmp_path):
    """Same sensors, cameras among them, whether they come from data or from sensor files."""
    (of_files, _), (_, of_data, _) = load(ROVER, tmp_path), load_robot_model(ROVER)
    cameras = [one.cameras[0].sensor for one in (of_files, of_data)]
    assert cameras[0].to_toml() == cameras[1].to_toml()
    assert cameras[0].polygons == cameras[1].polygons
    assert [one.summary() for one in of_files.sensors] == [one.summary() for one in of_data.sensors]
    assert of_files.kinematics == of_data.kinematics


def test_poses_are_those_of_links_and_frames(tmp_path):
    position, angles = (0.1, 0.2, 0.3), (0.4, -0.5, 0.6)
    numbers = " ".join(map(str, (*position, *angles)))
    inner = (
        f"<frame name='mast'><pose>{numbers}</pose></frame>"
        f"<link name='l'><pose>0 0 1 0 0 0</pose>{visual(BOX)}"
        + sensor("imu", "", rest="<pose relative_to='mast'>1 0 0 0 0 0</pose>")
        + "</link>"
    )
    (tmp_path / "a.sdf").write_text(sdf(f"<model name='m'>{inner}</model>"))
    vehicle, _ = load(tmp_path / "a.sdf", tmp_path)
    rotation = Rotation.from_euler("xyz", angles)
    (imu,) = vehicle.sensors
    assert imu.base_from_sensor[:3, 3] == pytest.approx(position + rotation.apply((1, 0, 0)))
    assert imu.base_from_sensor[:3, :3] == pytest.approx(rotation.as_matrix())


CAMERA = "<horizontal_fov>1.0</horizontal_fov><image><width>64</width><height>48</height></image>"


def test_a_camera_is_a_pinhole_and_with_depth_two_sensors(tmp_path):
    clip = "<clip><near>0.2</near><far>9</far></clip>"
    vehicle, _ = load_sensors(tmp_path, sensor("rgbd", f"<camera>{CAMERA}{clip}</camera>"))
    camera, depth = vehicle.sensors
    assert (camera.name, depth.name) == ("s", "s_depth")
    assert isinstance(camera.sensor.model, PerspectiveCamera)
    assert camera.sensor.model.focal_length_px == pytest.approx(32.0 / math.tan(0.5))
    assert camera.sensor.base_from_optical[:3, 2] == pytest.approx((1.0, 0.0, 0.0))
    assert depth.sensor.focal_length_px == pytest.approx(32.0 / math.tan(0.5))
    assert (depth.sensor.width_px, depth.sensor.height_px) == (64, 48)
    assert (depth.sensor.range_min_m, depth.sensor.range_max_m) == (0.2, 9.0)


def lidar(tag, horizontal, vertical=(), rest=""):
    axes = zip(("horizontal", "vertical"), (horizontal, vertical), strict=True)
    scan = "".join(
        f"<{axis}><samples>{values[0]}</samples><min_angle>{values[1]}</min_angle>"
        f"<max_angle>{values[2]}</max_angle></{axis}>"
        for axis, values in axes
        if values
    )
    return f"<{tag}><scan>{scan}</scan><range><min>0.3</min><max>30</max></range>{rest}</{tag}>"


@pytest.mark.parametrize(("kind", "tag"), [("gpu_lidar", "lidar"), ("ray", "ray")])
def test_a_lidar_has_its_rings_and_firings(tmp_path, kind, tag):
    text = lidar(tag, (360, -math.pi, math.pi * (1 - 2 / 360)), (16, -0.25, 0.25))
    vehicle, imported = load_sensors(
        tmp_path, sensor(kind, text, rest="<update_rate>20</update_rate>")
    )
    (found,) = vehicle.sensors
    assert found.sensor.firings == 360
    assert found.sensor.rate_hz == 20.0
    assert found.sensor.elevations_deg == pytest.approx(np.degrees(np.linspace(-0.25, 0.25, 16)))
    assert (found.sensor.range_min_m, found.sensor.range_max_m) == (0.3, 30.0)
    assert not any("all around" in notice for notice in imported.notices)


def test_a_planar_lidar_looks_where_its_middle_is_and_what_is_left_out_is_noted(tmp_path):
    plane = sensor("lidar", lidar("lidar", (91, 0.0, 0.5 * math.pi)))
    sector = sensor("lidar", lidar("lidar", (100, -0.5, 0.5), (4, -0.1, 0.1)), "wide")
    others = sensor("gps", ""), sensor("gps", "", "t")
    vehicle, imported = load_sensors(tmp_path, plane, sector, *others)
    scanner = vehicle.sensors[0]
    assert scanner.sensor.beams == 91
    assert scanner.base_from_sensor[:2, 0] == pytest.approx((0.5**0.5, 0.5**0.5))
    assert "wide: 57.3° wide, becomes 360° wide" in imported.notices
    assert "gps: left out (2 sensors)" in imported.notices
    assert "kinematics: left out: no plugin for a differential drive" in imported.notices


def test_a_model_of_a_world_is_chosen_by_its_name(tmp_path):
    imu = sensor("imu", "")
    text = world(model("a", visual(BOX) + imu) + model("b", visual(BOX)) + model("c", imu))
    (tmp_path / "a.world").write_text(text)
    with pytest.raises(RobotFileError, match="expected --class with the name of one model, got a"):
        load(tmp_path / "a.world", tmp_path)
    with pytest.raises(RobotFileError, match="no model 'd'; it has a, b, c"):
        load(tmp_path / "a.world", tmp_path, name="d")
    vehicle, imported = load(tmp_path / "a.world", tmp_path, name="a")
    assert vehicle.body is None
    assert any(notice.startswith("body: left out") for notice in imported.notices)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (sensor("camera", "<camera><image/></camera>"), "image/width: missing"),
        (sensor("lidar", lidar("lidar", (9, 1, 0))), "expected min_angle below max_angle"),
        (sensor("depth", "<camera><horizontal_fov>4</horizontal_fov></camera>"), "between 0 and"),
    ],
)
def test_a_sensor_that_is_none_is_named(tmp_path, text, message):
    with pytest.raises(RobotFileError, match=message) as info:
        load_sensors(tmp_path, text)
    assert str(info.value).startswith(f"{tmp_path / 'a.sdf'}: ")
    assert "sensor[s]" in str(info.value)


def test_a_drive_that_is_none_is_named(tmp_path):
    separation = "<wheel_separation>0.3&gt;</wheel_separation>"
    drive = f"<plugin name='gz::sim::systems::DiffDrive'>{separation}</plugin>"
    text = sdf(model("m", visual(BOX)), "1.9")
    (tmp_path / "a.sdf").write_text(text.replace("</model>", f"{drive}</model>"))
    with pytest.raises(RobotFileError, match=r"a\.sdf: .*wheel_separation: expected a number"):
        load(tmp_path / "a.sdf", tmp_path)


@pytest.mark.parametrize("is_stated", [True, False])
def test_what_is_found_at_the_import_is_found_later(tmp_path, monkeypatch, is_stated):
    models = tmp_path / "far" / "away" / "models"
    (models / "parts" / "meshes").mkdir(parents=True)
    trimesh.creation.box((0.6, 0.4, 0.3)).export(models / "parts" / "meshes" / "hull.stl")
    mesh = visual("<mesh><uri>model://parts/meshes/hull.stl</uri></mesh>", "hull")
    (tmp_path / "own").mkdir()
    (tmp_path / "own" / "a.sdf").write_text(sdf(model("m", visual(BOX) + mesh)))
    options = {"resources": [models]} if is_stated else {}
    monkeypatch.setenv("GZ_SIM_RESOURCE_PATH", "" if is_stated else str(models))
    _, imported = load(tmp_path / "own" / "a.sdf", tmp_path, **options)
    monkeypatch.delenv("GZ_SIM_RESOURCE_PATH")
    robot = imported.robot(tmp_path / "robot.toml")
    assert robot.resources == (str(Path("far", "away", "models")),)
    vehicle = Vehicle.load(tmp_path / "robot.toml")
    assert vehicle.body.instance_names == ("m/link/visual", "m/link/hull")
    assert vehicle.body.notices == ()
    # a model that needs none of them names no folder
    (tmp_path / "a.sdf").write_text(sdf(model("m", visual(BOX))))
    _, alone = load(tmp_path / "a.sdf", tmp_path, resources=[models])
    assert not alone.robot(tmp_path / "robot.toml").resources


def test_a_camera_with_distortion_is_left_out_and_the_others_stay(tmp_path):
    plain = sensor("camera", f"<camera>{CAMERA}</camera>", "plain")
    bent = f"<camera>{CAMERA}<distortion><k1>-0.2</k1></distortion></camera>"
    _, imported = load_sensors(tmp_path, plain, sensor("camera", bent, "bent"))
    assert [one.name for one in imported.sensors] == ["plain"]
    assert any(notice.startswith("camera bent: left out: ") for notice in imported.notices)
    assert any("distortion/k1: expected 0" in notice for notice in imported.notices)
