"""What clients ask of a simulation, in the order of their requests, and resets during measurements.

Nothing is rendered: an instrument that needs no OpenGL stands for all.
"""

import dataclasses
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from omnisim.core.errors import ServeError
from omnisim.core.pending import Pending
from omnisim.core.rate import SensorRate
from omnisim.rendering.sensor import Mount
from omnisim.robots import load_robot
from omnisim.robots.vehicle import Vehicle
from omnisim.runs.commanded_motion import CommandedMotion, WheelState
from omnisim.runs.ground import Ground
from omnisim.scene import read_scene
from omnisim.sensors.imu.imu import DEVICES, Imu
from omnisim.sensors.range_sensor.range_sensor import RangeReading, RangeSensor
from omnisim.serve import Publisher, ServeSettings, Simulation
from omnisim.serve.served_robot import Eye, InertialUnit


class Kept(Publisher):
    """Messages, by topic and stamp."""

    protocol = "kept"

    def __init__(self):
        self.messages = []

    def open(self, topics, controls):
        return ""

    def wants(self, topic):
        return True

    def publish(self, topic, stamp_ns, message):
        self.messages.append((topic, stamp_ns, message))

    def close(self):
        pass


class Sonar:
    """Instrument that calls a function while it measures."""

    def __init__(self, during):
        self.during, self.moments, self.x_m = during, [], []

    def begin(self, moment):
        self.moments.append(moment)

        def finish():
            self.during()
            pose = moment.motion(moment.time_s).world_from_object["robot"]
            self.x_m.append(pose[0, 3])
            return RangeReading(1.0, RangeSensor(), pose)

        return Pending(finish)


@pytest.fixture(scope="module")
def world():
    robot = Vehicle.from_robot(load_robot("p2at"))
    return read_scene("soccer"), dataclasses.replace(robot, sensors=())


@pytest.fixture
def simulation(world):
    scene, robot = world
    settings = ServeSettings(scene, {"robot": robot}, {"robot": (0.5, -0.25, 0.0)})
    return Simulation(settings, [Kept()])


def with_sonar(simulation, during, rate_hz=100.0):
    """The simulation with one instrument, which measures at a rate."""
    mount = Mount(RangeSensor(), "sonar", rate=SensorRate(rate_hz, 0.0, 0.0, "sonar"))
    sonar, (robot,) = Sonar(during), simulation._robots.values()
    robot.eyes.append(Eye.of(sonar, (), mount=mount, step_hz=10.0, seed=0))
    simulation._writer = ThreadPoolExecutor(1)
    return sonar


def motion(simulation):
    return next(iter(simulation._robots.values())).motion


def test_a_command_after_a_reset_is_kept(simulation):
    simulation.advance()
    simulation.reset()
    simulation.command("", 0.5, 0.0)
    simulation.advance()
    assert simulation.now_s == 0.01
    assert motion(simulation).state.speed_mps > 0.0


def test_a_reset_voids_what_was_asked_before(simulation):
    simulation.command("", 0.5, 0.0)
    simulation.set_pose("", 3.0, 0.0, 0.0)
    simulation.reset()
    simulation.advance()
    assert motion(simulation).state[:2] == (0.5, -0.25)
    assert motion(simulation).state.speed_mps == 0.0


def test_a_place_ends_the_command_before_it_and_not_the_one_after(simulation):
    simulation.command("", 0.5, 0.0)
    simulation.set_pose("", 3.0, 0.0, 0.0)
    simulation.advance()
    assert motion(simulation).state[:2] == (3.0, 0.0)
    simulation.set_pose("", -3.0, 0.0, 0.0)
    simulation.command("", 0.5, 0.0)
    simulation.advance()
    assert motion(simulation).state.x_m > -3.0


def test_what_is_asked_of_paused_time_takes_no_more_memory(simulation):
    """Once time advances, only the newest request of each kind is carried out."""
    for number in range(1000):
        simulation.set_pose("", 0.001 * number, 0.0, 0.0)
        simulation.command("", 0.1, 0.0)
    assert len(simulation._wishes) == 2
    simulation.advance()
    assert motion(simulation).state.x_m == pytest.approx(0.999, abs=1e-3)


@pytest.mark.parametrize("value", [float("nan"), float("inf"), -1e300, 10**400, "1"])
def test_numbers_that_are_none_are_one_line(simulation, value):
    with pytest.raises(ServeError, match=r"^turn_rate_radps = [^\n]{1,50}: expected a finite"):
        simulation.command("", 0.0, value)
    with pytest.raises(ServeError, match=r"^x_m = "):
        simulation.set_pose("", value, 0.0, 0.0)


def test_another_robot_is_one_line(simulation):
    with pytest.raises(ServeError, match=r"^robot 'robut': no such robot: did you mean 'robot'\?$"):
        simulation.command("robut", 0.0, 0.0)


def test_a_measurement_that_a_reset_overtakes_is_not_published(simulation):
    """It keeps to the motion in which it began, and is no predecessor of the next one."""

    def reset():
        if simulation.now_s > 0.03:
            simulation.finish()  # those before are published
            simulation.reset()
            simulation.advance()

    sonar = with_sonar(simulation, reset)
    for _ in range(5):
        simulation.command("", 0.5, 0.0)
        simulation.advance()
        simulation.measure()
    simulation.finish()
    (kept,) = simulation.publishers
    stamps = [stamp_ns for topic, stamp_ns, _ in kept.messages if topic == "/sonar/range"]
    times_s = [round(moment.time_s, 3) for moment in sonar.moments]
    assert times_s == [0.0, 0.01, 0.02, 0.03, 0.04, 0.0, 0.01, 0.02]
    assert stamps == [0, 10_000_000, 20_000_000, 30_000_000, 0, 10_000_000, 20_000_000]
    assert sonar.x_m[4] > sonar.x_m[3] > sonar.x_m[5] == 0.5
    assert sonar.moments[5].previous_s is None


def test_the_previous_measurement_is_the_last_that_began(simulation):
    """A sensor faster than the ticks has several measurements in progress at once."""
    sonar = with_sonar(simulation, lambda: None, rate_hz=1000.0)
    for _ in range(3):
        simulation.advance()
        simulation.measure()
    simulation.finish()
    assert [moment.number for moment in sonar.moments] == list(range(31))
    previous = [moment.previous_s for moment in sonar.moments][1:]
    assert previous == pytest.approx([0.001 * number for number in range(30)])


def test_readings_of_an_imu_do_not_depend_on_who_reads_them_when(world):
    """Nor on how many become due at once: 6 s are more than one block of errors."""
    mount = Mount(Imu(DEVICES["adis16448"], 200.0), "imu", rate=SensorRate(200.0, 0.0, 0.0, "imu"))
    ground, limits = Ground(world[0]), world[1].kinematics
    driven = CommandedMotion(WheelState(0.0, 0.0, 0.0, 0.0), limits, ground, timeout_s=9.0)
    driven.command(0.5, 0.8)
    driven.advance(6.0)

    def readings(times_s, wanted_from_s=0.0):
        unit = InertialUnit(mount, 10.0, 3)
        return [
            reading
            for time_s in times_s
            for reading in unit.readings(driven, time_s, time_s >= wanted_from_s)
        ]

    at_once = readings([5.9])
    one_by_one = readings(np.arange(0.0, 5.9, 0.0125))
    later = readings(np.arange(0.0, 5.9, 0.0125), wanted_from_s=5.4)
    assert len(at_once) > len(one_by_one) > 1170 > 110 > len(later) > 90
    for some in (one_by_one, later):
        stamps_s, values = zip(*some, strict=True)
        offset = [stamp_s for stamp_s, _ in at_once].index(stamps_s[0])
        expected = at_once[offset : offset + len(some)]
        assert list(stamps_s) == [stamp_s for stamp_s, _ in expected]
        np.testing.assert_allclose(values, [value for _, value in expected], atol=1e-12)
