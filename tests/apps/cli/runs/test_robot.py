"""`omnisim robot`: output, files and errors."""

import shutil
from pathlib import Path

from omnisim.robots import load_robot
from omnisim.robots.vehicle import Vehicle
from omnisim.sensors.sensor_registry import parse_sensors

SAMPLE = Path(__file__).resolve().parents[3] / "robots" / "importers" / "usarsim" / "sample.ini"
SCANNER = "(ItemClass=class'USARBot.SICKLMS',ItemName=\"a\",Position=(X=0.1,Y=0,Z=-0.2))"


def test_list(quiet):
    assert quiet("robot", "list") == (
        "p2at        Pioneer 2 AT: skid steering, 1.2 m/s, 300 °/s; omnicam, lms200\n"
        "superscout  Nomad Super Scout II: differential drive, 1 m/s, 90 °/s; omnicam\n"
    )


def test_check_summarizes_a_robot(quiet):
    assert quiet("robot", "check", "p2at").splitlines() == [
        "p2at: valid",
        "  robot    p2at, Pioneer 2 AT",
        "  body     p2at.glb, 9956 triangles, 18 nodes",
        "  drive    skid steering, 1.2 m/s, 300 °/s",
        "  odometry with errors",
        "  size     0.626 × 0.505 × 0.67 m, ground clearance 0.05 m",
        "  camera   omnicam, hyperbolic 360 × 360 px, 3600 polygons (auto), "
        "effective viewpoint (-0.08, 0, 0.65) m",
        "  scanner  lms200, 361 beams at 0.5° to 8.19 m, origin (0.16, 0, 0.361) m, "
        "does not see lms200",
    ]


def test_check_of_a_minimal_robot(quiet, tmp_path):
    (tmp_path / "a.toml").write_text('name = "cart"\n')
    assert quiet("robot", "check", "a.toml") == (
        "a.toml: valid\n  robot    cart, cart\n  body     none\n  drive    no kinematics\n"
        "  odometry ideal\n  size     unknown: no collision checking\n"
    )


def test_import_writes_a_robot_and_lists_omissions(ran, quiet, tmp_path):
    shutil.copy(SAMPLE, tmp_path / "USARBot.ini")
    words = "--class", "OmniP2AT", "-o", "robot.toml", "--origin-height", 0.12
    out, error = ran("robot", "import", "USARBot.ini", *words)
    assert out == (
        "robot.toml: omnip2at of [USARBot.OmniP2AT], Omni (omnicamera), "
        "Scanner1 (usarsim_range_scanner), F1 (usarsim_sonar)\n"
    )
    lines = error.splitlines()
    assert len(lines) == 10
    assert all(line.startswith("note: USARBot.ini:") for line in lines)
    assert "note: USARBot.ini:25: Sensors 'Odometry' (USARBot.OdometrySensor): left out" in lines
    names = [mount.name for mount in parse_sensors(load_robot(tmp_path))]
    assert names == ["Omni", "Scanner1", "F1"]
    out = quiet("robot", "check", ".")
    assert "181 beams at 0.9998° to 20 m, origin (0.16, 0, 0.361) m" in out


def test_import_in_unreal_units(ran, refused, tmp_path):
    line = SCANNER.replace("0.1", "40").replace("-0.2", "50")
    (tmp_path / "a.ini").write_text(f"[USARBot.P2AT]\nSensors={line}\n")
    line = refused("robot", "import", "a.ini", "-o", "a.toml")
    assert "a.ini:2: Position X = 40 m: expected at most 10 m; 250 to a meter are read" in line
    ran("robot", "import", "a.ini", "-o", "a.toml", "--unreal-units")
    assert parse_sensors(load_robot(tmp_path / "a.toml"))[0].position_m == (0.16, 0.0, 0.2)


def test_import_keeps_existing_files(refused, tmp_path):
    (tmp_path / "r.toml").write_text("mine")
    (tmp_path / "a.ini").write_text("[a]\n")
    refused("robot", "import", "a.ini", "-o", "r.toml")
    assert (tmp_path / "r.toml").read_text() == "mine"
    (tmp_path / "p.ini").write_text(f"[USARBot.P2AT]\nSensors={SCANNER}\n")
    (tmp_path / "p.toml").symlink_to("p.ini")
    line = refused("robot", "import", "p.ini", "-o", "p.toml")
    assert "expected a name other than the configuration's, got p.toml" in line
    assert "SICKLMS" in (tmp_path / "p.ini").read_text()


def test_a_model_with_an_impossible_sensor_leaves_no_sensor_files(refused, tmp_path):
    """A camera is first, whose sensor file is not written where the robot file cannot be."""
    lens = "<horizontal_fov>1</horizontal_fov><image><width>8</width><height>8</height></image>"
    far = "<pose>2000 0 0 0 0 0</pose>"
    (tmp_path / "m.sdf").write_text(
        '<sdf version="1.9"><model name="m"><link name="l">'
        f'<sensor name="eye" type="camera"><camera>{lens}</camera></sensor>'
        f'<sensor name="imu" type="imu">{far}</sensor></link></model></sdf>'
    )
    assert "position_m" in refused("robot", "import", "m.sdf", "-o", "r.toml")


def test_a_sensor_is_added_to_a_built_in_robot(quiet, tmp_path):
    imu = '[[sensors]]\nname = "imu"\ntype = "imu"\nposition_m = [0.0, 0.0, 0.1]\nrate_hz = 200.0\n'
    (tmp_path / "scout.toml").write_text(f'extends = "p2at"\n{imu}')
    out = quiet("robot", "show", "scout.toml")
    (tmp_path / "saved.toml").write_text(out)
    assert "extends" not in out
    extending, saved = Vehicle.load(tmp_path / "scout.toml"), Vehicle.load(tmp_path / "saved.toml")
    assert [sensor.name for sensor in extending.sensors] == ["omnicam", "lms200", "imu"]
    assert extending.given == saved.given
    assert extending.body.triangle_count == Vehicle.load("p2at").body.triangle_count


def test_a_robot_is_shown_with_its_comments_and_can_be_saved(quiet, refused, tmp_path):
    out = quiet("robot", "show", "p2at")
    assert out.startswith("# Pioneer 2 AT. Base frame: x forward")
    (tmp_path / "saved.toml").write_text(out)
    saved, own = (Vehicle.load(name).sensors for name in (tmp_path / "saved.toml", "p2at"))
    assert [sensor.name for sensor in saved] == [sensor.name for sensor in own]
    refused("robot", "show", "p2a")
