"""From USARBot.ini to a robot file: places, scanners, the omnidirectional camera, and the rest."""

import math
import re
from pathlib import Path

import numpy as np
import pytest

from omnisim.core.errors import RobotFileError
from omnisim.core.poses import rotation_from_roll_pitch_yaw
from omnisim.robots.importers.usarsim import import_robot
from omnisim.sensors.sensor_registry import parse_sensors

SAMPLE = Path(__file__).with_name("sample.ini")
OURS_FROM_USARSIM = np.diag([1.0, -1.0, -1.0])


def robot_of(imported):
    return imported.robot(Path("robot.toml"))


@pytest.fixture
def of(tmp_path):
    """Imports a file with one robot of some lines, and what follows its section."""
    path = tmp_path / "a.ini"

    def import_lines(*lines, after="", **options):
        path.write_text("\n".join(["[USARBot.P2AT]", *lines, after]))
        return import_robot(path, **options)

    return import_lines


def part(item="SICKLMS", name="n", place="X=0,Y=0,Z=0", turn="X=0,Y=0,Z=0", key="Sensors", more=""):
    return (
        f"{key}=(ItemClass=class'USARBot.{item}',ItemName=\"{name}\",Position=({place}),"
        f"Direction=({turn}){more})"
    )


def test_the_sample():
    imported = import_robot(SAMPLE, "OmniP2AT", origin_height_m=0.12)
    robot = robot_of(imported)
    assert (robot.name, robot.title, robot.kinematics) == ("omnip2at", "OmniP2AT", None)
    omni, scanner, sonar = parse_sensors(robot)
    assert (sonar.name, sonar.type) == ("F1", "usarsim_sonar")
    assert sonar.position_m == (0.145, 0.13, 0.12)
    assert (omni.name, omni.type, omni.position_m) == ("Omni", "omnicamera", (-0.08, -0.02, 0.65))
    assert omni.yaw_deg == pytest.approx(-90.0, abs=1e-5)  # the mirror's: to the right
    assert (omni.roll_deg, omni.pitch_deg) == (0.0, 0.0)
    assert (scanner.name, scanner.type) == ("Scanner1", "usarsim_range_scanner")
    assert scanner.position_m == (0.16, 0.0, 0.361)
    assert (scanner.scan_fov_rad, scanner.resolution_rad) == (3.14159, 0.01745)
    assert (scanner.max_range_m, scanner.noise_share) == (20.0, 0.001)


def test_nothing_is_dropped_silently():
    """Each line of the robot's section is in the file: as a sensor's origin, or as left out."""
    imported = import_robot(SAMPLE, "OmniP2AT", origin_height_m=0.12)
    lines = SAMPLE.read_text().splitlines()
    first, last = lines.index("[USARBot.OmniP2AT]") + 1, lines.index("[USARBot.P2DX]")
    for number, line in enumerate(lines[first:last], start=first + 1):
        if "=(" in line:
            assert f"# line {number}: " in imported.text(Path("robot.toml")), line
        elif "=" in line and not line.startswith(";"):
            assert line.partition("=")[0] in imported.text(Path("robot.toml"))
    notices = [notice.removeprefix(f"{SAMPLE}:") for notice in imported.notices]
    assert notices == [
        "6: [USARBot.OmniP2AT] bDebug, Weight, ChassisMass: left out",
        "9: JointParts 'LeftFront': left out",
        "10: JointParts 'RightFront': left out",
        "11: MisPkgs 'PanTilt': left out",
        "12: HeadLight 'Lamp' (USARBot.USARHeadLight): left out",
        "13: Effecters 'Releaser' (USARBot.RFIDReleaser): left out",
        "14: Cameras 'Ahead' (USARBot.RobotCamera): left out",
        "24: Sensors 'F1' (USARBot.SonarSensor): no [USARBot.SonarSensor]: assumed to be "
        "USARSim's sonar",
        "25: Sensors 'Odometry' (USARBot.OdometrySensor): left out",
        "30: [USARBot.SICKLMS] HiddenSensor, ScanInterval: left out",
    ]
    for notice in notices:
        assert f"# line {notice}" in imported.text(Path("robot.toml"))


def test_axes(of):
    """The rotation between the frames is half a turn about x, on both sides of the mount's."""
    roll, pitch, yaw = 0.3, -0.4, 2.5
    text = part(place="X=1,Y=2,Z=3", turn=f"X={roll},Y={pitch},Z={yaw}")
    (mount,) = parse_sensors(robot_of(of(text)))
    assert mount.position_m == (1.0, -2.0, -3.0)
    rotation = rotation_from_roll_pitch_yaw(roll, pitch, yaw)  # in the frame with z down
    expected = OURS_FROM_USARSIM @ rotation @ OURS_FROM_USARSIM
    np.testing.assert_allclose(mount.base_from_mount[:3, :3], expected, atol=1e-9)
    assert "-0.0" not in of(part()).text(Path("robot.toml"))


def test_units_of_the_engine(of):
    """A quarter of a turn to the right is 16384; 250 are 1 m; z is up."""
    text = part(place="X=40,Y=25,Z=50", turn="Pitch=8192,Yaw=16384,Roll=0")
    scanner = "[USARBot.SICKLMS]\nScanFov=32768\nResolution=182\nMaxRange=5000\n"
    (mount,) = parse_sensors(robot_of(of(text, after=scanner, unreal_units=True)))
    assert mount.position_m == (0.16, -0.1, 0.2)
    assert (mount.roll_deg, mount.pitch_deg, mount.yaw_deg) == (0.0, -45.0, -90.0)
    assert mount.scan_fov_rad == pytest.approx(math.pi)
    assert mount.resolution_rad == pytest.approx(math.radians(1.0), rel=1e-3)
    assert mount.max_range_m == 20.0


def test_origin_height(of):
    (mount,) = parse_sensors(robot_of(of(part(place="Z=-0.3"), origin_height_m=0.1)))
    assert mount.position_m == (0.0, 0.0, 0.4)
    imported = of(part(place="Z=-0.3"))
    assert parse_sensors(robot_of(imported))[0].position_m == (0.0, 0.0, 0.3)
    assert any("--origin-height" in notice for notice in imported.notices)


def test_whole_cameras_are_one_each_and_virtual_ones_a_level_camera(of):
    imported = of(part("OmniCam", "Eye", "X=0.1,Y=0,Z=-0.5", "X=0,Y=0,Z=0.5"), origin_height_m=0)
    (mount,) = parse_sensors(robot_of(imported))
    assert (mount.name, mount.type, mount.position_m) == ("Eye", "omnicamera", (0.1, 0.0, 0.5))
    assert mount.yaw_deg == pytest.approx(-math.degrees(0.5))
    assert imported.notices == ()
    views = [part("CameraTextureClient", f"V{k}", "Z=-0.5", f"Z={k}") for k in range(4)]
    (mount,) = parse_sensors(robot_of(of(*views)))
    assert (mount.name, mount.position_m) == ("V0", (0.0, 0.0, 0.5))
    assert (mount.roll_deg, mount.pitch_deg, mount.yaw_deg) == (0.0, 0.0, 0.0)
    two = of(part("OmniCam", "A", "Z=-0.5"), part("OmniCam", "B", "Z=-0.7"))
    assert [mount.name for mount in parse_sensors(robot_of(two))] == ["A", "B"]


@pytest.mark.parametrize(
    ("place", "turn", "is_lens"),
    [
        ("Z=-0.4", "Y=1.5707963", True),
        ("Z=-0.4", "Y=0", False),  # it looks ahead
        ("Z=-0.6", "Y=1.5707963", False),  # it is above the mirror
        ("X=0.1,Z=-0.4", "Y=1.5707963", False),  # it is beside the axis
    ],
)
def test_the_lens_is_below_the_mirror_and_looks_up(of, place, turn, is_lens):
    camera = part("RobotCamera", "Lens", place, turn, key="Cameras")
    imported = of(part("ParabolicMirror", "Omni", "Z=-0.5"), camera)
    assert [mount.name for mount in parse_sensors(robot_of(imported))] == ["Omni"]
    left_out = any("Cameras 'Lens' (USARBot.RobotCamera): left out" in n for n in imported.notices)
    assert left_out != is_lens


def test_scanners_with_and_without_their_section(of):
    imported = of(part(), origin_height_m=0)
    assert "scan_fov_rad" not in imported.text(Path("robot.toml"))
    assert imported.notices[0].endswith("no [USARBot.SICKLMS]: assumed to be USARSim's SICK LMS200")
    others = of(part("Hokuyo"))
    assert parse_sensors(robot_of(others)) == ()
    words = "no [USARBot.Hokuyo] with ScanFov, Resolution and MaxRange: left out"
    assert words in others.notices[-1]
    section = "[usarbot.myscanner]\nscanfov=4.0\nresolution=0.1\nmaxrange=4\n"
    (mount,) = parse_sensors(robot_of(of(part("MyScanner"), after=section)))
    assert (mount.scan_fov_rad, mount.max_range_m, mount.noise_share) == (4.0, 4.0, 0.0)


def test_what_is_not_understood_of_a_sensor_is_said(of):
    imported = of(part(more=',Parent="Tilt",Postion=(X=1)'), origin_height_m=0)
    words = "\n".join(imported.notices)
    assert "Sensors 'n' (USARBot.SICKLMS): Postion: left out" in words
    assert "is mounted on 'Tilt': placed on the chassis" in words
    assert not any("HARD" in n for n in of(part(more=',Parent="HARD"')).notices)


def test_a_sonar_and_an_infrared_sensor(of):
    """Settings as in USARSim's own configuration, with its semicolons."""
    after = """[USARBot.SonarSensor]
ScanInterval=0.2
MaxRange=4.0
MinRange=0.05
beamAngle=0.3;
maxAngleOfIncidence=0.1745329252;
numberOfCones=5
tracesPerCone=12;
[USARBot.IRSensor]
MaxRange=1.2
Noise=0.01
"""
    imported = of(
        part("SonarSensor", "S", "X=0.1,Y=0.2,Z=0", "Z=-1.5707963"),
        part("IRSensor", "I"),
        after=after,
        origin_height_m=0,
    )
    sonar, infrared = parse_sensors(robot_of(imported))
    assert (sonar.type, sonar.position_m) == ("usarsim_sonar", (0.1, -0.2, 0.0))
    assert sonar.yaw_deg == pytest.approx(90.0, abs=1e-5)
    assert (sonar.range_max_m, sonar.range_min_m, sonar.beam_angle_rad) == (4.0, 0.05, 0.3)
    assert (sonar.cones, sonar.rays_per_cone) == (5, 12)
    assert (infrared.type, infrared.range_max_m) == ("usarsim_ir_sensor", 1.2)
    assert (infrared.range_min_m, infrared.noise_share) == (0.2, 0.01)
    (notice,) = imported.notices
    assert notice.endswith("[USARBot.SonarSensor] ScanInterval, maxAngleOfIncidence: left out")


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("MaxRange=-1", ":5: MaxRange = -1: expected 0 or more"),
        ("MinRange=7", ":5: MinRange = 7: expected MinRange, 7 m, less than MaxRange, 5 m"),
        ("beamAngle=4", ":5: beamAngle = 4: expected more than 0 and less than half a turn"),
        ("tracesPerCone=1.5", ":5: tracesPerCone = 1.5: expected a whole number from 1 to 360"),
        ("numberOfCones=0", ":5: numberOfCones = 0: expected a whole number from 1 to 360"),
        ("Noise=loud", ":5: Noise = loud: expected a finite number"),
    ],
)
def test_a_sonar_that_cannot_be_is_refused_at_its_line(of, line, message):
    with pytest.raises(RobotFileError, match=re.escape(message)):
        of(part("SonarSensor"), after=f"\n[USARBot.SonarSensor]\n{line}")


def test_what_is_no_sensor_may_be_anything_but_unbalanced(of):
    imported = of(part("TouchSensor"))
    assert parse_sensors(robot_of(imported)) == ()
    assert "[USARBot.P2AT] has no sensor that omnisim knows" in imported.notices[0]
    lamp = part("USARHeadLight", "Lamp", "X=bright", key="HeadLight")
    removed = part("SICKLMS", "Old", key="-Sensors")
    imported = of(lamp, removed, part(), origin_height_m=0)
    assert [mount.name for mount in parse_sensors(robot_of(imported))] == ["n"]
    words = "\n".join(imported.notices)
    assert ":2: HeadLight 'Lamp': left out" in words
    assert ":3: -Sensors 'Old': left out" in words


def test_odd_names_become_names_of_folders(of):
    imported = of(part(name="../a\\\x7f#]é=x\tb"))
    (mount,) = parse_sensors(robot_of(imported))
    assert mount.name == "___a_ __é_x b"
    assert any("becomes '___a_ __é_x b'" in notice for notice in imported.notices)


@pytest.mark.parametrize(
    ("wanted", "words"),
    [
        (None, r":27: a second robot: expected --class with one of OmniP2AT, P2DX$"),
        ("P2DY", r":1: no robot of class 'P2DY'; did you mean 'P2DX'\?$"),
        ("Zzz", r":1: no robot of class 'Zzz'; it has OmniP2AT, P2DX$"),
        ("SICKLMS", r":30: \[USARBot\.SICKLMS\] has no Sensors= line$"),
    ],
)
def test_which_robot(wanted, words):
    for name in ("p2dx", "P2DX", "usarbot.P2DX"):
        assert import_robot(SAMPLE, name).section == "[USARBot.P2DX]"
    with pytest.raises(RobotFileError, match=words):
        import_robot(SAMPLE, wanted)


@pytest.mark.parametrize(
    ("lines", "words"),
    [
        (["Weight=1"], r":1: no section of it has a Sensors= line$"),
        ([part().rstrip(")")], r":2: Sensors: a parenthesis is not closed$"),
        (["JointParts=(A=1", part()], r":2: JointParts: a parenthesis is not closed$"),
        (["Sensors=1"], r":2: Sensors=1: expected \(\.\.\.\)$"),
        (['Sensors=(ItemName="a")'], r":2: Sensors: no ItemClass: expected ItemClass=\.\.\.$"),
        (["Sensors=(ItemClass=class'a.b')"], r":2: Sensors: no ItemName: expected ItemName="),
        ([part(), part()], r":3: ItemName 'n' again, as in line 2: expected each name once$"),
        ([part(place="X=a")], r":2: Position X = a: expected a finite number$"),
        ([part(place="X=nan")], r":2: Position X = nan: expected a finite number$"),
        ([part(place="X=(Y=1)")], r":2: Position X = \(\.\.\.\): expected a finite number$"),
        ([part(place="W=1")], r":2: Position: W: expected X, Y and Z$"),
        ([part().replace("(X=0,Y=0,Z=0)", "0")], r":2: Position=0: expected Posi"),
        ([part(place="X=40")], r"X = 40 m: expected at most 10 m; 250 .* --unreal-units$"),
        ([part(turn="Z=16384")], r"Direction Z = 16384: expected radians, .* --unreal-units$"),
    ],
)
def test_broken_input(of, tmp_path, lines, words):
    with pytest.raises(RobotFileError, match=words) as caught:
        of(*lines)
    assert str(caught.value).startswith(f"{tmp_path / 'a.ini'}:")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("ScanFov=32768", r":4: ScanFov = 32768: expected radians, at most"),
        ("ScanFov=-1", r":4: ScanFov = -1: expected more than 0$"),
        ("Noise=-1", r":4: Noise = -1: expected 0 or more$"),
        ("Resolution=1e-9", r":4: Resolution = 1e-9: expected at most a turn and"),
        ("MinRange=30", r":4: MinRange = 30 m: expected less than MaxRange, 20 m$"),
        ("MaxRange=far", r":4: MaxRange = far: expected a finite number$"),
    ],
)
def test_a_scanner_that_cannot_be_is_refused_at_its_line(of, line, words):
    with pytest.raises(RobotFileError, match=words):
        of(part(), after=f"[USARBot.SICKLMS]\n{line}")


def test_units_that_cannot_be_the_engines(of):
    words = r"Direction Z = 1\.57: expected whole numbers, 65536 to"
    with pytest.raises(RobotFileError, match=words):
        of(part(turn="Z=1.57"), unreal_units=True)
    with pytest.raises(RobotFileError, match="origin height nan m: expected a number up to 10"):
        of(part(), origin_height_m=math.nan)
