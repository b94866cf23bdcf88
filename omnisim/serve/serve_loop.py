"""Loop of a served simulation: against the wall clock, as fast as it can, or step by step."""

from __future__ import annotations

import math
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Literal

from omnisim.core.errors import ServeError
from omnisim.runs.commanded_motion import TICK_S, TICKS_PER_S
from omnisim.serve.publisher import Client
from omnisim.serve.served_world import Served

ClockMode = Literal["wall", "fast", "lockstep"]
MAX_STEP_S = 3600.0  # of one request
MAX_STEPS = 64  # requests that wait
WAIT_S = 0.1  # after which the loop looks whether it should end
LATE_S = 0.5  # simulated time that the wall clock may be ahead of; more is left out


class ServeLoop:
    """Loop of a simulation, and the `Controls` of its clients.

    Args:
        simulation: the simulation, which `run` opens and closes.
        clock: "wall": simulated time follows the wall clock, and measurements that come too late
            are skipped; "fast": as fast as it can, every measurement; "lockstep": only `step`
            advances it.
        duration_s: simulated time at which to end; None: never.

    Attributes:
        late_s: wall-clock time that was left out, since the machine was too slow.
    """

    def __init__(
        self, simulation: Served, clock: ClockMode = "wall", duration_s: float | None = None
    ):
        self._simulation, self._clock = simulation, clock
        self._duration_s = math.inf if duration_s is None else duration_s
        self._is_paused = clock == "lockstep"
        self._is_ended = False
        self._steps: deque[tuple[float, Callable[[float], None] | None]] = deque()
        self._news = threading.Condition()
        self._ticking = threading.Lock()  # so that time which is paused stands still
        self.late_s = 0.0

    # Controls.

    @property
    def robots(self) -> Sequence[str]:
        """Names of the robots."""
        return self._simulation.robots

    def command(self, robot: str, speed_mps: float, turn_rate_radps: float) -> None:
        """Drive at a speed and turn rate until the next command or the timeout."""
        self._simulation.command(robot, speed_mps, turn_rate_radps)

    def set_pose(self, robot: str, x_m: float, y_m: float, yaw_rad: float) -> None:
        """Put a robot at a place, at rest."""
        self._simulation.set_pose(robot, x_m, y_m, yaw_rad)

    def reset(self) -> None:
        """Begin again: time 0, all robots at their starts."""
        self._simulation.reset()

    def pause(self, is_paused: bool) -> None:
        """Stop or resume simulated time."""
        if self._clock == "lockstep":
            raise ServeError("pause: expected none in lockstep, where only step advances the time")
        with self._news:
            self._is_paused = is_paused
            self._news.notify_all()

    def step(self, seconds: float, then: Callable[[float], None] | None = None) -> None:
        """Advance paused or lockstepped simulated time; see `Controls`."""
        if not TICK_S <= seconds <= MAX_STEP_S:  # nor is NaN
            expected = f"expected {TICK_S:g} to {MAX_STEP_S:g} s"
            raise ServeError(f"step: seconds = {str(seconds)[:50]}: {expected}")
        with self._news:
            if not self._is_paused:
                raise ServeError("step: expected a paused or lockstepped simulation")
            if len(self._steps) >= MAX_STEPS:
                raise ServeError("step: too many requests at once")
            self._steps.append((seconds, then))
            self._news.notify_all()

    @property
    def is_paused(self) -> bool:
        """True while only `step` advances simulated time."""
        return self._is_paused

    @property
    def now_s(self) -> float:
        """Simulated time."""
        return self._simulation.now_s

    @property
    def clients(self) -> Sequence[Client]:
        """Connected clients of all protocols."""
        return [each for server in self._simulation.publishers for each in server.clients]

    def end(self) -> None:
        """End `run`."""
        with self._news:
            self._is_ended = True
            self._news.notify_all()

    # The loop.

    def run(self) -> None:
        """Serve an open simulation until `end`, or its duration; in the thread that opened it.

        Raises:
            OmnisimError: a sensor cannot measure.
        """
        with ThreadPoolExecutor(1, "omnisim-clock") as threads:
            following = threads.submit(self._follow_wall_clock) if self._clock == "wall" else None
            try:
                while not self._is_over:
                    if self._steps:
                        self._make_step(*self._steps.popleft())
                    elif self._is_paused:
                        self._wait(WAIT_S)
                    elif self._clock == "fast":
                        self._tick()
                        self._simulation.measure()
                    elif not self._simulation.measure(skips=True):
                        self._wait(TICK_S)
                self._simulation.finish()
            finally:
                self.end()
        if following is not None:
            following.result()  # raises what ended it

    @property
    def _is_over(self) -> bool:
        simulation = self._simulation
        return self._is_ended or simulation.now_s >= min(simulation.end_s, self._duration_s)

    def _tick(self, by_step: bool = False) -> bool:
        """Advance by a tick; False: not now, as steps advance only paused time."""
        with self._ticking:
            if self._is_over or self._is_paused != by_step:
                return False
            self._simulation.advance()
        return True

    def _make_step(self, seconds: float, then: Callable[[float], None] | None) -> None:
        """Advance tick by tick, so that it makes no difference how steps divide the time."""
        simulation = self._simulation
        for _ in range(round(seconds * TICKS_PER_S)):
            if not self._tick(by_step=True):
                break
            simulation.measure()
        simulation.finish()
        if then is not None:
            then(simulation.now_s)

    def _follow_wall_clock(self) -> None:
        """Advance simulated time with the wall clock, in a thread of its own."""
        last_s, due_s = time.monotonic(), 0.0
        try:
            while not self._is_over:
                time.sleep(max(0.0, TICK_S - due_s))
                now_s = time.monotonic()
                due_s, last_s = due_s + now_s - last_s, now_s
                if self._is_paused:
                    due_s = 0.0
                    continue
                if due_s > LATE_S:
                    self.late_s += due_s - LATE_S
                    due_s = LATE_S
                while due_s >= TICK_S and self._tick():
                    due_s -= TICK_S
                with self._news:
                    self._news.notify_all()
        finally:
            self.end()

    def _wait(self, seconds: float) -> None:
        with self._news:
            if not (self._steps or self._is_ended):
                self._news.wait(seconds)
