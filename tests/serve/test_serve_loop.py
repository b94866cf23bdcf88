"""The loop of a served world, with worlds that need no OpenGL: time, steps, resets, and faults."""

import threading
import time

import pytest

from omnisim.core.errors import RunError, ServeError
from omnisim.runs.commanded_motion import TICK_S
from omnisim.serve.serve_loop import ServeLoop
from omnisim.serve.served_world import Served


class World(Served):
    """World that only counts; `at_tick` is called at each tick."""

    def __init__(self, at_tick=lambda now_s: None):
        self.publishers, self.topics, self.now_s = [], [], 0.0
        self.at_tick, self.is_reset = at_tick, False

    robots = ("robot",)

    def open(self):
        pass

    def announce(self):
        pass

    def command(self, robot, speed_mps, turn_rate_radps):
        pass

    def set_pose(self, robot, x_m, y_m, yaw_rad):
        pass

    def reset(self):
        self.is_reset = True

    def advance(self):
        if self.is_reset:
            self.is_reset, self.now_s = False, 0.0
        self.now_s = round(self.now_s + TICK_S, 9)
        self.at_tick(self.now_s)


class Run:
    """Loop that runs in a thread, and what it raised."""

    def __init__(self, loop):
        self.loop, self.error = loop, None
        self.thread = threading.Thread(target=self._run, daemon=True)

    def _run(self):
        try:
            self.loop.run()
        except Exception as error:
            self.error = error

    def __enter__(self):
        self.thread.start()
        return self.loop

    def __exit__(self, *_):
        self.loop.end()
        self.thread.join(10.0)
        assert not self.thread.is_alive()

    def step(self, seconds):
        """Time that a step reaches."""
        reached, done = [], threading.Event()
        self.loop.step(seconds, lambda now_s: (reached.append(now_s), done.set()))
        assert done.wait(10.0)
        return reached[0]


@pytest.mark.parametrize("clock", ["wall", "fast"])
def test_a_fault_while_time_advances_ends_the_loop(clock):
    def fail(now_s):
        raise RunError("a fault")

    run = Run(ServeLoop(World(fail), clock))
    run.thread.start()
    run.thread.join(10.0)
    assert not run.thread.is_alive()
    assert str(run.error) == "a fault"


def test_a_fault_of_a_sensor_ends_the_clock_too():
    class Blind(World):
        def measure(self, skips=False):
            raise RunError("blind")

    threads = threading.active_count()
    run = Run(ServeLoop(Blind(), "wall"))
    run.thread.start()
    run.thread.join(10.0)
    assert str(run.error) == "blind"
    assert threading.active_count() == threads


def test_a_reset_begins_again_and_goes_on_tick_by_tick():
    times_s = []
    run = Run(ServeLoop(World(times_s.append), "lockstep"))
    with run as loop:
        assert run.step(1.0) == pytest.approx(1.0)
        loop.reset()
        assert run.step(0.02) == pytest.approx(0.02)
    assert times_s[100:] == [0.01, 0.02]


def test_steps_of_paused_time_are_exact_while_the_clock_would_tick():
    """Paused time stands still at once: the clock's thread adds nothing to a step."""
    run = Run(ServeLoop(World(lambda now_s: time.sleep(0.003)), "wall"))
    with run as loop:
        for _ in range(20):
            loop.pause(False)
            time.sleep(0.02)
            loop.pause(True)
            first_s = run.step(TICK_S)
            assert run.step(0.05) == pytest.approx(first_s + 0.05)


def test_the_end_ends_a_long_step():
    began = threading.Event()
    loop = ServeLoop(World(lambda now_s: (began.set(), time.sleep(0.01))), "lockstep")
    with Run(loop):
        loop.step(3600.0)
        assert began.wait(10.0)


def test_resumed_time_ends_a_long_step():
    run = Run(ServeLoop(World(lambda now_s: time.sleep(0.001)), "wall"))
    with run as loop:
        loop.pause(True)
        reached, done = [], threading.Event()
        loop.step(3600.0, lambda now_s: (reached.append(now_s), done.set()))
        time.sleep(0.05)
        loop.pause(False)
        assert done.wait(10.0)
        assert reached[0] < 3600.0


def test_a_step_ends_with_the_duration():
    world = World()
    loop = ServeLoop(world, "lockstep", duration_s=0.5)
    run = Run(loop)
    with run:
        assert run.step(3600.0) == pytest.approx(0.5)
        run.thread.join(10.0)
        assert not run.thread.is_alive()
    assert world.now_s == 0.5


@pytest.mark.parametrize(
    "seconds", [0.0, -1.0, float("nan"), float("inf"), 10**400, 3601.0, TICK_S / 2]
)
def test_steps_without_a_sensible_duration_are_one_line(seconds):
    with pytest.raises(ServeError, match=r"^step: seconds = [^\n]{1,50}: expected 0.01 to 3600 s$"):
        ServeLoop(World(), "lockstep").step(seconds)


def test_requests_that_wait_are_bounded():
    loop = ServeLoop(World(), "lockstep")
    for _ in range(64):
        loop.step(1.0)
    with pytest.raises(ServeError, match="too many requests"):
        loop.step(1.0)


def test_only_paused_time_is_stepped_and_lockstep_is_never_resumed():
    with pytest.raises(ServeError, match="paused or lockstepped"):
        ServeLoop(World(), "wall").step(1.0)
    with pytest.raises(ServeError, match="pause"):
        ServeLoop(World(), "lockstep").pause(False)
