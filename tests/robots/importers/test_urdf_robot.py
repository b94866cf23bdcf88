"""Robots of URDF as robot files: wheels by their joints, masses, sensors of Gazebo's elements."""

import math
import tomllib
from pathlib import Path

import numpy as np
import pytest

from omnisim.core.errors import RobotFileError
from omnisim.robots.importers.importers import import_model, load_robot_model
from omnisim.robots.vehicle import Vehicle

TROLLEY = Path(__file__).parents[3] / "examples" / "trolley.urdf"
BOX = "<visual><geometry><box size='0.4 0.3 0.1'/></geometry></visual>"


def wheel(name, x, y, z, radius=0.1, kind="continuous", axis="0 1 0", parent="base", limit=""):
    """Link with a tire, and its joint."""
    tire = f"<origin rpy='1.5708 0 0'/><geometry><cylinder radius='{radius}' length='0.04'/>"
    mass = "<inertial><mass value='0.5'/></inertial>"
    return (
        f"<link name='{name}'>{mass}<visual>{tire}</geometry></visual></link>"
        f"<joint name='{name}_joint' type='{kind}'><parent link='{parent}'/><child link='{name}'/>"
        f"<origin xyz='{x} {y} {z}'/><axis xyz='{axis}'/>{limit}</joint>"
    )


def urdf(*parts, base=BOX):
    return f"<robot name='cart'><link name='base'>{base}</link>{''.join(parts)}</robot>"


def load(tmp_path, text):
    """Vehicle and table of the robot file of a URDF."""
    (tmp_path / "cart.urdf").write_text(text)
    imported = import_model(tmp_path / "cart.urdf")
    output = tmp_path / "robot.toml"
    imported.write(output)
    return Vehicle.load(output), tomllib.loads(output.read_text()), imported.notices


def test_the_example_drives_on_two_wheels(tmp_path):
    imported = import_model(TROLLEY)
    table = tomllib.loads(imported.text(tmp_path / "robot.toml"))
    assert table["kinematics"]["type"] == "differential"
    assert (table["kinematics"]["track_m"], table["kinematics"]["wheel_diameter_m"]) == (0.6, 0.4)
    assert "body_offset_m" not in table  # it stands on the ground already
    (notice,) = imported.notices
    assert notice.startswith("not stated, but assumed: max_speed_mps = 1, ")


def test_the_base_is_on_the_ground_between_the_wheels(tmp_path):
    limit = "<limit effort='1' velocity='5'/>"
    parts = [wheel(f"w{y}", -0.15, y, -0.05, limit=limit) for y in (0.2, -0.2)]
    vehicle, table, _ = load(tmp_path, urdf(*parts))
    assert table["body_offset_m"] == [0.15, 0.0, 0.15]
    assert vehicle.body.bounds_m()[0, 2] == pytest.approx(0.0, abs=1e-4)  # 1.5708 is not quite π/2
    tire = next(instance for instance in vehicle.body.instances if instance.name.startswith("w0.2"))
    assert tire.world_from_node[:3, 3] == pytest.approx((0.0, 0.2, 0.1))
    assert table["kinematics"]["max_speed_mps"] == pytest.approx(0.5)  # 5 rad/s
    assert table["footprint"]["clearance_m"] == 0.05


def test_four_wheels_skid(tmp_path):
    places = [(x, y) for x in (0.3, -0.1) for y in (0.25, -0.25)]
    parts = [wheel(f"w{k}", x, y, 0.1) for k, (x, y) in enumerate(places)]
    vehicle, table, _ = load(tmp_path, urdf(*parts))
    found = table["kinematics"]
    assert found["type"] == "skid_steer"
    assert (found["track_m"], found["wheelbase_m"]) == (0.5, 0.4)
    assert table["body_offset_m"] == [-0.1, 0.0, 0.0]
    assert vehicle.kinematics.drive == "skid_steer"


@pytest.mark.parametrize(
    "other",
    [
        wheel("lidar", 0.1, 0.0, 0.3, axis="0 0 1"),
        wheel("flipper", 0.1, 0.3, 0.1, kind="revolute", limit="<limit lower='-1' upper='1'/>"),
        wheel("swivel", 0.3, 0.0, 0.1, axis="0 0 1")
        + wheel("caster", 0.0, 0.0, -0.05, 0.05, parent="swivel"),
        wheel("fan", 0.0, 0.1, 0.5, 0.05),
    ],
    ids=["lidar", "flipper", "caster", "above the ground"],
)
def test_what_turns_otherwise_is_no_wheel(tmp_path, other):
    pair = wheel("left", 0.0, 0.2, 0.1) + wheel("right", 0.0, -0.2, 0.1)
    _, table, _ = load(tmp_path, urdf(pair, other))
    assert table["kinematics"]["type"] == "differential"
    assert table["kinematics"]["track_m"] == 0.4


@pytest.mark.parametrize(
    ("parts", "names"),
    [("", "none"), (wheel("a", 0, 0.2, 0.1), "a_joint"), (wheel("a", 0, 0, 0.1), "a_joint")],
)
def test_robots_without_pairs_of_wheels_have_no_drive(tmp_path, parts, names):
    vehicle, table, notices = load(tmp_path, urdf(parts))
    assert vehicle.kinematics is None
    assert "kinematics" not in table
    (notice,) = notices
    assert notice.startswith("kinematics: left out: expected wheels in pairs, left and right, on")
    assert notice.endswith(f"got {names}")


def test_masses_are_those_that_mujoco_reads(tmp_path):
    mujoco = pytest.importorskip("mujoco", reason="MuJoCo, an extra, is not installed")
    inertia = "<inertia ixx='.1' iyy='.1' izz='.1' ixy='0' ixz='0' iyz='0'/>"
    inertial = f"<inertial><origin xyz='0.1 0 0.2'/><mass value='7'/>{inertia}</inertial>"
    pair = wheel("left", 0.0, 0.2, 0.1) + wheel("right", 0.0, -0.2, 0.1)
    text = urdf(pair, base=BOX + inertial).replace("'0.5'/></", f"'0.5'/>{inertia}</")
    _, table, _ = load(tmp_path, text)
    keep = "<mujoco><compiler fusestatic='false' discardvisual='false'/></mujoco>"
    model = mujoco.MjModel.from_xml_string(text.replace("<link", keep + "<link", 1))
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    assert table["physics"]["mass_kg"] == pytest.approx(model.body_subtreemass[0])
    assert table["physics"]["center_height_m"] == pytest.approx(data.subtree_com[0][2], abs=1e-6)


def test_sensors_of_gazebos_elements_are_on_their_links(tmp_path):
    camera = (
        "<camera><horizontal_fov>1.0</horizontal_fov>"
        "<image><width>64</width><height>48</height></image></camera>"
    )
    mast = (
        "<link name='mast'/><joint name='m' type='fixed'><parent link='base'/><child link='mast'/>"
        f"<origin xyz='0.1 0 0.5' rpy='0 0 {math.pi / 2}'/></joint>"
    )
    sensors = (
        "<gazebo reference='mast'><sensor name='eye' type='camera'><pose>0.1 0 0 0 0 0</pose>"
        f"{camera}</sensor><sensor name='gps' type='navsat'/></gazebo>"
    )
    plugin = (
        "<gazebo><plugin filename='libgazebo_ros_diff_drive.so' name='d'>"
        "<max_linear_acceleration>0.7</max_linear_acceleration></plugin></gazebo>"
    )
    pair = wheel("left", 0.0, 0.2, 0.0) + wheel("right", 0.0, -0.2, 0.0)
    vehicle, table, notices = load(tmp_path, urdf(pair, mast, sensors, plugin))
    (eye,) = vehicle.sensors
    assert eye.origin_m == pytest.approx((0.1, 0.1, 0.6))  # the base is 0.1 m below the axle
    np.testing.assert_allclose(eye.sensor.base_from_optical[:3, 2], (0.0, 1.0, 0.0), atol=1e-9)
    assert table["kinematics"]["max_acceleration_mps2"] == 0.7
    assert "navsat: left out (1 sensor)" in notices


def test_a_model_is_a_robot_without_a_robot_file(tmp_path):
    pair = wheel("left", 0.0, 0.2, 0.0) + wheel("right", 0.0, -0.2, 0.0)
    (tmp_path / "cart.urdf").write_text(urdf(pair))
    robot, vehicle, notices = load_robot_model(tmp_path / "cart.urdf")
    assert robot.chassis.wheel_diameter_m == 0.2
    assert vehicle.body.name == "cart.urdf"  # wherever it is
    assert len(notices) == 1


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("<robot name='a'/>", r"cart\.urdf: robot: expected a <link>, got none"),
        ("<robot", r"cart\.urdf: not XML"),
        (urdf(wheel("a", 0, 0.1, 0.1, radius="x")),
         r"link\[a\]/visual/geometry/cylinder: radius: expected a number, got 'x'"),
    ],
)  # fmt: skip
def test_damaged_files_are_refused_in_one_line(tmp_path, text, message):
    (tmp_path / "cart.urdf").write_text(text)
    with pytest.raises(RobotFileError, match=message) as info:
        import_model(tmp_path / "cart.urdf")
    assert "\n" not in str(info.value)


def test_files_that_are_not_there_or_have_no_class():
    with pytest.raises(RobotFileError, match=r"^nowhere\.urdf: no such file$"):
        load_robot_model(Path("nowhere.urdf"))
    with pytest.raises(RobotFileError, match="--class: expected none, as the file has one robot"):
        import_model(TROLLEY, "trolley")
