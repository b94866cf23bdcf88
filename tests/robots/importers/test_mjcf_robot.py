"""Robots of MuJoCo's models as robot files: wheels, masses, cameras, IMUs."""

import tomllib

import numpy as np
import pytest

pytest.importorskip("mujoco", reason="MuJoCo, an extra, is not installed")

from omnisim.core.errors import OmnisimError, RobotFileError
from omnisim.robots.importers.importers import import_model
from omnisim.robots.vehicle import Vehicle

TIRE = '<geom type="cylinder" size=".1 .03" zaxis="0 1 0" mass="1"/>'


def wheel(name, x, y, joint='axis="0 1 0"', tire=TIRE):
    return f'<body name="{name}" pos="{x} {y} 0"><joint name="{name}" {joint}/>{tire}</body>'


PAIR = wheel("left", -0.05, 0.2) + wheel("right", -0.05, -0.2)


def model(inner, rest="", world=""):
    return (
        f'<mujoco model="m"><worldbody>{world}<body name="cart" pos="0 0 0.3"><freejoint/>'
        f'<geom name="deck" type="box" size=".3 .2 .05" pos=".1 0 .1" mass="6"/>{inner}</body>'
        f"</worldbody>{rest}</mujoco>"
    )


def load(tmp_path, text):
    """Vehicle and table of the robot file of a model."""
    (tmp_path / "cart.xml").write_text(text)
    imported = import_model(tmp_path / "cart.xml")
    output = tmp_path / "robot.toml"
    imported.write(output)
    return Vehicle.load(output), tomllib.loads(imported.text(tmp_path / "robot.toml"))


def test_wheels_are_bodies_on_hinges_without_limits(tmp_path):
    others = wheel("lidar", 0, 0, 'axis="0 0 1"') + wheel("arm", 0.2, 0.3, 'range="-1 1"')
    vehicle, table = load(tmp_path, model(PAIR + others))
    found = table["kinematics"]
    assert (found["type"], found["track_m"]) == ("differential", 0.4)
    assert found["wheel_diameter_m"] == 0.2
    assert table["body_offset_m"] == [0.05, 0.0, -0.2]
    tire = next(
        instance for instance in vehicle.body.instances if instance.name.startswith("left/")
    )
    assert tire.world_from_node[:3, 3] == pytest.approx((0.0, 0.2, 0.1))
    assert table["physics"] == {"mass_kg": 10.0, "center_height_m": 0.16}


def test_tires_can_be_meshes(tmp_path):
    angles = np.linspace(0.0, 2.0 * np.pi, 64, endpoint=False)
    rims = [(0.1 * np.cos(a), y, 0.1 * np.sin(a)) for y in (-0.02, 0.02) for a in angles]
    vertices = " ".join(f"{value:.6f}" for point in rims for value in point)
    asset = f'<asset><mesh name="tire" vertex="{vertices}"/></asset>'
    tire = '<geom type="mesh" mesh="tire" mass="1"/>'
    pair = wheel("left", 0, 0.2, tire=tire) + wheel("right", 0, -0.2, tire=tire)
    _, table = load(tmp_path, model(pair, asset))
    assert table["kinematics"]["wheel_diameter_m"] == pytest.approx(0.2, rel=1e-3)
    assert table["kinematics"]["track_m"] == pytest.approx(0.4, abs=1e-4)


def test_cameras_and_imus_are_sensors_where_mujoco_has_them(tmp_path):
    camera = '<camera name="eye" pos=".4 0 .3" xyaxes="0 -1 0 0 0 1" fovy="60" resolution="64 48"/>'
    site = '<site name="chip" pos="0 0 .1"/>'
    rest = '<sensor><gyro site="chip"/><accelerometer site="chip"/></sensor>'
    vehicle, _ = load(tmp_path, model(PAIR + camera + site, rest))
    eye, chip = vehicle.sensors
    lens = eye.sensor.model
    assert (lens.width_px, lens.height_px) == (64, 48)
    assert lens.focal_length_px == pytest.approx(24.0 / np.tan(np.radians(30.0)))
    assert eye.origin_m == pytest.approx((0.45, 0.0, 0.4))
    np.testing.assert_allclose(eye.sensor.base_from_optical[:3, 2], (1.0, 0.0, 0.0), atol=1e-9)
    np.testing.assert_allclose(eye.sensor.base_from_optical[:3, 1], (0.0, 0.0, -1.0), atol=1e-9)
    assert chip.base_from_sensor[:3, 3] == pytest.approx((0.05, 0.0, 0.2))


def test_the_floor_of_a_model_is_left_out(tmp_path):
    floor = '<geom name="floor" type="plane" size="9 9 1"/>'
    alone, table = load(tmp_path, model(PAIR))
    vehicle, with_floor = load(tmp_path, model(PAIR, world=floor))
    assert "left out, as they belong to the world: floor" in (tmp_path / "robot.toml").read_text()
    assert with_floor == table  # footprint, mass and wheels
    assert vehicle.body.instance_names == alone.body.instance_names


def test_a_model_of_several_robots_or_none_is_refused(tmp_path):
    far = '<camera name="eye" pos="0 1e300 0" xyaxes="0 -1 0 0 0 1"/>'
    for text, words in (
        (
            model(PAIR, world='<body name="box"/>'),
            "the model of one robot, got box, cart$",
        ),
        ("<mujoco><worldbody/></mujoco>", "got no body"),
        ("<mujoco>", "cannot be read by MuJoCo"),
        (model(PAIR + far), r"position_m.*expected"),
    ):
        with pytest.raises(RobotFileError, match=words) as info:
            load(tmp_path, text)
        assert "\n" not in str(info.value)


def test_without_the_extra_one_line_names_it(tmp_path, monkeypatch):
    (tmp_path / "cart.xml").write_text(model(PAIR))
    monkeypatch.setattr("omnisim.core.extras.is_installed", lambda module: module != "mujoco")
    with pytest.raises(OmnisimError, match=r"cart\.xml needs mujoco-core: pip install"):
        import_model(tmp_path / "cart.xml")
