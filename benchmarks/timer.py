"""The one timer: variants in turns, one process, and how sure their ratios are."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

WARM_UP = 20
ROUNDS = 30
CONFIDENCE = 0.95


@dataclass(frozen=True)
class Ratio:
    """How many times as long one variant takes as another: the median of paired rounds.

    Attributes:
        median: it.
        low, high: an interval that holds the true median with at least 95 % probability.
    """

    median: float
    low: float
    high: float


@dataclass(frozen=True, eq=False)
class Timings:
    """Every round, by variant; the same round of two variants is a pair.

    Attributes:
        seconds: by the wall clock.
        processor_seconds: of all threads of this process together, which other processes on the
            machine hardly touch. All the work where the renderer is software; on a GPU only what
            Python and the driver do.
    """

    seconds: dict[str, NDArray[np.float64]]
    processor_seconds: dict[str, NDArray[np.float64]]

    def percentile_ms(self, variant: str, percent: float) -> float:
        """Milliseconds that so many percent of the rounds stay below."""
        return 1e3 * float(np.percentile(self.seconds[variant], percent))

    def cheapest(self) -> str:
        """The variant that is cheapest next to the others of its rounds."""
        of_round = np.mean(list(self.seconds.values()), axis=0)
        return min(self.seconds, key=lambda name: float(np.median(self.seconds[name] / of_round)))

    def ratio(self, variant: str, to: str) -> Ratio:
        """How many times as long `variant` takes as `to`."""
        return _ratio(self.seconds[variant], self.seconds[to])

    def processor_ratio(self, variant: str, to: str) -> Ratio:
        """How many times as much of the processor `variant` takes as `to`."""
        return _ratio(self.processor_seconds[variant], self.processor_seconds[to])


def take_turns(
    variants: Mapping[str, Callable[[], object]],
    rounds: int = ROUNDS,
    warm_up: int = WARM_UP,
) -> Timings:
    """Time variants in turns, A B C A B C, so that a slow minute of the machine meets them all.

    Args:
        variants: each does its work and waits until it is done.
        rounds: timed turns.
        warm_up: turns before, not timed: shaders compile at their first use.
    """
    for _ in range(warm_up):
        for work in variants.values():
            work()
    seconds = {name: np.empty(rounds) for name in variants}
    processor_seconds = {name: np.empty(rounds) for name in variants}
    for turn in range(rounds):
        for name, work in variants.items():
            start, busy = time.perf_counter(), time.process_time()
            work()
            seconds[name][turn] = time.perf_counter() - start
            processor_seconds[name][turn] = time.process_time() - busy
    return Timings(seconds, processor_seconds)


def _ratio(one: NDArray[np.float64], other: NDArray[np.float64]) -> Ratio:
    ratios = np.sort(one / other)
    outer = _outer(len(ratios))
    return Ratio(float(np.median(ratios)), float(ratios[outer]), float(ratios[-1 - outer]))


def _outer(count: int) -> int:
    """How many of the sorted values to leave out at either end for a median's interval.

    The true median is left of k values with a binomial probability, whatever the distribution.
    """
    tail, left_out = 0.0, 0
    for k in range(count // 2):
        tail += math.comb(count, k) * 0.5**count
        if 2.0 * tail > 1.0 - CONFIDENCE:
            break
        left_out = k
    return left_out
