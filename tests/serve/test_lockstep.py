"""A lockstepped simulation repeats to the byte, and equals a drive along the same commands."""

import dataclasses
import threading
from contextlib import contextmanager

import numpy as np
import pytest

from omnisim.core.files.image_files import read_image
from omnisim.robots import load_robot
from omnisim.robots.vehicle import Vehicle
from omnisim.runs.drive import Drive
from omnisim.runs.route import Route
from omnisim.scene import read_scene
from omnisim.serve import PlainPublisher, ServeLoop, ServeSettings, Simulation, connect

ROBOT = """
extends = "p2at"

[[sensors]]
type = "imu"
name = "imu"
position_m = [0.0, 0.0, 0.3]

[[sensors]]
type = "lidar"
name = "lidar"
rate_hz = 10.0
elevations_deg = [-15.0, -5.0, 0.0, 5.0]
firings = 90
position_m = [0.0, 0.0, 0.9]
"""
START = (0.5, -0.25, 0.3)
COMMANDS = ((0.4, 0.0), (0.4, 0.8), (0.1, -1.0), (0.0, 0.0), (0.5, 0.2))


@pytest.fixture(scope="module")
def vehicle(tmp_path_factory):
    file = tmp_path_factory.mktemp("robot") / "robot.toml"
    file.write_text(ROBOT)
    loaded = Vehicle.from_robot(load_robot(file)).with_cameras(size_px=64, quality="fast")
    camera = loaded.camera()
    return dataclasses.replace(loaded, sensors=(camera, *loaded.sensors[1:]))


@contextmanager
def served(vehicle, clock="lockstep", **settings):
    """Address of a simulation in a thread of its own, and the simulation."""
    publisher = PlainPublisher(port=0, keeps_all=clock == "lockstep")
    simulation = Simulation(
        ServeSettings(
            read_scene("soccer"), {"p2at": vehicle}, {"p2at": START}, rate_hz=5.0, **settings
        ),
        [publisher],
    )
    loop, addresses, ready = ServeLoop(simulation, clock), [], threading.Event()

    def run():
        simulation.open()
        publisher.open(simulation.topics, loop)
        addresses.append(publisher.url)
        simulation.announce()
        ready.set()
        loop.run()
        simulation.close()

    thread = threading.Thread(target=run)
    thread.start()
    assert ready.wait(120.0)
    try:
        yield addresses[0], simulation
    finally:
        loop.end()
        publisher.close()
        thread.join()


def _lap(address, is_again=False):
    """Messages of a lap by commands, in steps of 0.2 s; again: after a reset."""
    messages = []
    with connect(address, topics=["*"]) as robot:
        if is_again:
            robot.reset()
        for command in COMMANDS:
            robot.command(*command)
            robot.step(0.2)
            while (message := robot.next()) is not None:
                messages.append(message)
        assert robot.dropped == 0
    return messages


def _flat(value):
    if isinstance(value, dict):
        return {key: _flat(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_flat(item) for item in value]
    return value.tobytes() if isinstance(value, np.ndarray) else value


@pytest.fixture(scope="module")
def lap(vehicle):
    with served(vehicle, keeps_commands=True) as (address, simulation):
        return _lap(address), simulation.commands("p2at")


def _of(messages, topic):
    return [message for message in messages if message.topic == topic]


def test_lockstep_repeats_to_the_byte_also_after_a_reset(vehicle, lap):
    with served(vehicle, keeps_commands=True) as (address, simulation):
        again = _lap(address)
        after_reset = _lap(address, is_again=True)
        assert simulation.commands("p2at") == lap[1]
    streams = {message.topic for message in again}
    assert {"/omnicam/image_raw", "/lidar/points", "/imu/data_raw", "/odom", "/tf"} <= streams
    for topic in streams:
        one, other, third = (
            [(each.stamp_ns, _flat(each.fields)) for each in _of(messages, topic)]
            for messages in (lap[0], again, after_reset)
        )
        assert one == other == third, topic


def test_stamps_are_the_simulated_clock(lap):
    messages, _ = lap
    clock = [message.stamp_ns for message in _of(messages, "/clock")]
    assert clock == [10_000_000 * k for k in range(1, 101)]
    imu = [message.stamp_ns for message in _of(messages, "/imu/data_raw")]
    assert imu == [5_000_000 * k for k in range(200)]  # 1 s lacks the half period after it
    images = [message.stamp_ns for message in _of(messages, "/omnicam/image_raw")]
    assert images == [200_000_000 * k for k in range(6)]
    clouds = _of(messages, "/lidar/points")
    assert [cloud.stamp_ns for cloud in clouds] == [100_000_000 * k for k in range(11)]
    assert set(clouds[-1].points.dtype.names) >= {"x", "y", "z", "intensity", "ring", "time"}


def test_a_drive_along_the_commands_has_the_same_bytes(tmp_path, vehicle, lap):
    messages, commands = lap
    file = tmp_path / "commands.csv"
    file.write_text(commands)
    drive = Drive(read_scene("soccer"), vehicle, Route(str(file), rate_hz=5.0))
    *_, _ = drive.plan().record(tmp_path / "run")
    for number, message in enumerate(_of(messages, "/omnicam/image_raw")):
        recorded, _ = read_image(tmp_path / f"run/omnicam/{number:06d}.png")
        np.testing.assert_array_equal(message.image, recorded)
    rows = np.loadtxt(tmp_path / "run/imu/readings.csv", delimiter=",", skiprows=1)
    for message, row in zip(_of(messages, "/imu/data_raw"), rows, strict=False):
        rate, force = message.fields["angular_velocity"], message.fields["linear_acceleration"]
        values = [*(rate[axis] for axis in "xyz"), *(force[axis] for axis in "xyz")]
        assert values == pytest.approx(row[1:], abs=1e-9)  # printed digits
    odometry = np.loadtxt(tmp_path / "run/odometry.csv", delimiter=",", skiprows=1)
    for message, row in zip(_of(messages, "/odom"), odometry, strict=True):
        position = message.fields["pose"]["pose"]["position"]
        assert (position["x"], position["y"]) == pytest.approx(row[3:5], abs=2e-9)  # printed digits
