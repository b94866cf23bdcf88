"""Parts of robots' formats: each changes the robot, is noted, or is known to be harmless."""

import copy
from xml.etree import ElementTree

import pytest

from omnisim.core.errors import RobotFileError
from omnisim.robots.importers.importers import import_model
from omnisim.robots.importers.usarsim import import_robot
from omnisim.scene.formats.features import ROBOT_TABLES, Support, feature_table
from tests.robots.importers.test_mjcf_robot import PAIR
from tests.robots.importers.test_mjcf_robot import model as mujoco_model
from tests.robots.importers.usarsim.test_usarsim_robot import SAMPLE
from tests.scene.formats.sdf.worlds import sdf

NOISE = "<noise><type>gaussian</type><mean>0.1</mean><stddev>0.02</stddev></noise>"
HARMLESS = """<always_on>1</always_on><visualize>1</visualize><enable_metrics>1</enable_metrics>
<topic>t</topic><plugin name="p" filename="f"/>"""
HEAD = '<update_rate>7</update_rate><pose degrees="true">1 0 0 0 0 90</pose>' + HARMLESS
IMAGE = """<horizontal_fov>1.1</horizontal_fov><image><width>64</width><height>48</height>
<format>L8</format><anti_aliasing>2</anti_aliasing></image><clip><near>0.2</near><far>9</far></clip>
<save enabled="true"><path>p</path></save><visibility_mask>3</visibility_mask>"""
AXES = (
    """<scan><horizontal><samples>90</samples><resolution>2</resolution><min_angle>-1</min_angle>
<max_angle>1</max_angle></horizontal><vertical><samples>{rings}</samples><resolution>3</resolution>
<min_angle>-0.1</min_angle><max_angle>0.2</max_angle></vertical></scan><range><min>0.3</min>
<max>20</max><resolution>0.01</resolution></range>"""
    + NOISE
)
IMU_NOISE = """<noise><type>gaussian</type><mean>0.1</mean><stddev>0.02</stddev><bias_mean>1
</bias_mean><bias_stddev>2</bias_stddev><dynamic_bias_stddev>3</dynamic_bias_stddev>
<dynamic_bias_correlation_time>4</dynamic_bias_correlation_time><precision>5</precision></noise>"""
NAMES = """wheel_radius wheel_separation max_linear_velocity max_angular_velocity
max_linear_acceleration max_angular_acceleration max_velocity min_velocity max_wheel_torque
left_joint odom_topic"""
LIMITS = "".join(f"<{name}>0.5</{name}>" for name in NAMES.split())
# A sensor or plugin of each table, with all kinds of its parts.
PARTS = {
    ("camera", "camera"): f'<sensor name="s" type="camera">{HEAD}<camera name="c">{IMAGE}{NOISE}'
    "<lens><type>equidistant</type></lens></camera></sensor>",
    ("camera", "depth"): f'<sensor name="s" type="depth">{HEAD}<camera name="c">{IMAGE}</camera>'
    "</sensor>",
    ("lidar", "rings"): f'<sensor name="s" type="gpu_lidar">{HEAD}<lidar>{AXES.format(rings=4)}'
    "</lidar></sensor>",
    ("lidar", "plane"): f'<sensor name="s" type="ray">{HEAD}<ray>{AXES.format(rings=1)}'
    "</ray></sensor>",
    ("imu", "imu"): f'<sensor name="s" type="imu">{HEAD}<imu><angular_velocity><x>{IMU_NOISE}</x>'
    f"</angular_velocity><enable_orientation>1</enable_orientation></imu></sensor>",
    ("drive", "drive"): f'<plugin filename="libdiff_drive.so" name="d">{LIMITS}</plugin>',
}  # fmt: skip
# Parts that state what is so without them, or that another part makes needless.
SAME = {
    ("camera", "camera"): "camera@name",
    ("camera", "depth"): "camera@name",
    ("lidar", "rings"): "",
    ("lidar", "plane"): "vertical/samples vertical/min_angle vertical/max_angle range/resolution",
    ("imu", "imu"): "",
    ("drive", "drive"): "plugin@name",
}  # fmt: skip


def _outcome(folder, part):
    """Robot file and notices of a model with a sensor or a plugin, or the error."""
    text = ElementTree.tostring(part, encoding="unicode")
    link = f'<link name="l">{text if part.tag == "sensor" else ""}</link>'
    plugin = text if part.tag == "plugin" else ""
    (folder / "a.sdf").write_text(sdf(f'<model name="m">{link}{plugin}</model>'))
    try:
        imported = import_model(folder / "a.sdf")
    except RobotFileError as reason:
        return str(reason)
    cameras = {name: camera.to_toml() for name, camera in imported.cameras.items()}
    return imported.text(folder / "robot.toml"), imported.notices, cameras


def _without_each(root):
    """Copies of a tree, each without a part: its name alone, and with that of its parent."""
    for number, element in enumerate(root.iter()):
        for name in element.attrib:
            other = copy.deepcopy(root)
            del list(other.iter())[number].attrib[name]
            yield f"@{name}", f"{element.tag}@{name}", other
        for index, child in enumerate(element):
            other = copy.deepcopy(root)
            parent = list(other.iter())[number]
            parent.remove(parent[index])
            yield child.tag, f"{element.tag}/{child.tag}", other


APART = ("save", "plugin")  # within ignored parts


@pytest.mark.parametrize("case", PARTS, ids=lambda case: case[1])
def test_each_part_of_a_sensor_changes_the_robot_or_is_noted(case, tmp_path):
    assert {table for table, _ in PARTS} == set(ROBOT_TABLES)
    root = ElementTree.fromstring(PARTS[case])
    whole, known = _outcome(tmp_path, root), {}
    assert not isinstance(whole, str), whole
    for one in feature_table(case[0]):
        known |= dict.fromkeys((name.removesuffix("/*") for name in one.names), one.support)
    wrong = []
    for name, path, other in _without_each(root):
        support = known.get(path, known.get(name))
        if path.split("/")[0].split("@")[0] in APART:
            continue
        is_same = _outcome(tmp_path, other) == whole
        if is_same != (support is Support.IGNORED or path in SAME[case].split()):
            wrong.append((path, support, is_same))
    assert wrong == []


@pytest.mark.parametrize("case", PARTS, ids=lambda case: case[1])
def test_unknown_parts_of_a_sensor_are_named(case, tmp_path):
    root = ElementTree.fromstring(PARTS[case])
    count = len(list(root.iter()))
    for number in range(count):
        other = copy.deepcopy(root)
        element = list(other.iter())[number]
        is_text = element.text and element.text.strip()
        if is_text or element.tag in ("plugin", "lens", "type", "save"):
            continue
        ElementTree.SubElement(element, "halo").text = "1"
        assert any("not read: halo" in one for one in _outcome(tmp_path, other)[1]), element.tag


def test_sensors_of_mujoco_without_a_counterpart_are_noted(tmp_path):
    pytest.importorskip("mujoco", reason="MuJoCo, an extra, is not installed")
    kinds = ("gyro", "rangefinder", "touch", "magnetometer")
    sensors = "".join(f'<{kind} site="i"/>' for kind in kinds)
    inner = PAIR + '<site name="i"/><camera/><camera name="own"/>'
    world = '<camera name="room"/>'
    (tmp_path / "a.xml").write_text(mujoco_model(inner, f"<sensor>{sensors}</sensor>", world))
    notices = import_model(tmp_path / "a.xml").notices
    assert "left out, as omnisim has no such sensor: magnetometer, rangefinder, touch" in notices
    assert "left out: camera room is the world's" in notices
    assert any(
        notice.startswith("left out: camera") and "has no name" in notice for notice in notices
    )
    (tmp_path / "a.xml").write_text(mujoco_model(PAIR + '<site name="i"/><camera name="own"/>'))
    assert not any("left out" in notice for notice in import_model(tmp_path / "a.xml").notices)


@pytest.mark.parametrize("robot", ["OmniP2AT", "P2DX"])
def test_unknown_keys_of_usarsim_are_named(robot, tmp_path):
    """In the robot's section, its parts, and the sections of their classes."""
    lines = SAMPLE.read_text().splitlines()
    sections = ["USARBot.SICKLMS", f"USARBot.{robot}"]
    for section in sections:
        at = lines.index(f"[{section}]") + 1
        path = tmp_path / "a.ini"
        path.write_text("\n".join([*lines[:at], "Halo=3", *lines[at:]]))
        notices = import_robot(path, robot).notices
        assert any("Halo" in notice and "left out" in notice for notice in notices), section
    first = lines.index(f"[{sections[1]}]")
    at = next(n for n, line in enumerate(lines) if "SICKLMS'" in line and n > first)
    lines[at] = lines[at].replace("(Item", "(Halo=1,Item", 1)
    path.write_text("\n".join(lines))
    assert any("Halo: left out" in notice for notice in import_robot(path, robot).notices)
