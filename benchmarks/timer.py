"""The one timer: interleaved variants in one process, and confidence intervals of their ratios."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

WARM_UP = 20
ROUNDS = 30
CONFIDENCE = 0.95


@dataclass(frozen=True)
class MedianInterval:
    """Median over rounds, and its confidence interval.

    Attributes:
        median: of the rounds.
        low, high: an interval that holds the true median with at least 95 % probability, given
            six rounds or more.
    """

    median: float
    low: float
    high: float

    def flat(self, name: str) -> dict[str, float]:
        """For a row of a report: `name`, `name_low` and `name_high`."""
        return {name: self.median, f"{name}_low": self.low, f"{name}_high": self.high}


@dataclass(frozen=True, eq=False)
class Timings:
    """Seconds of every round, by variant; the same round of two variants is a pair.

    Attributes:
        seconds: by the wall clock.
        processor_seconds: of all threads of this process together; other processes hardly change
            them. All the work of a software renderer; on a GPU only Python and the driver.
    """

    seconds: dict[str, NDArray[np.float64]]
    processor_seconds: dict[str, NDArray[np.float64]]

    def percentile_ms(self, variant: str, percent: float) -> float:
        """Percentile of the rounds in milliseconds."""
        return 1e3 * float(np.percentile(self.seconds[variant], percent))

    def cheapest(self) -> str:
        """Variant that is cheapest relative to its rounds' means."""
        of_round = np.mean(list(self.seconds.values()), axis=0)
        return min(self.seconds, key=lambda name: float(np.median(self.seconds[name] / of_round)))

    def row(self, variant: str) -> dict[str, float]:
        """Columns of a report that concern one variant alone."""
        return {
            "fps": self.frames_per_second(variant).median,
            **{f"p{percent}_ms": self.percentile_ms(variant, percent) for percent in (50, 95, 99)},
        }

    def frames_per_second(self, variant: str) -> MedianInterval:
        """Runs per second, one after the other."""
        return _median_interval(1.0 / self.seconds[variant])

    def ratio(self, variant: str, to: str) -> MedianInterval:
        """Ratio of the times of `variant` and `to`, paired by rounds."""
        return _median_interval(self.seconds[variant] / self.seconds[to])

    def processor_ratio(self, variant: str, to: str) -> MedianInterval:
        """Ratio of the processor times of `variant` and `to`, paired by rounds."""
        return _median_interval(self.processor_seconds[variant] / self.processor_seconds[to])

    def cost_ms(self, variant: str, without: str) -> MedianInterval:
        """Milliseconds that `variant` takes longer than `without`, paired by rounds."""
        return _median_interval(1e3 * (self.seconds[variant] - self.seconds[without]))


def without_progress(steps: Iterable[int], what: str, total: int) -> Iterator[int]:
    """Iterate over the steps without a progress bar."""
    yield from steps


def time_interleaved(
    variants: Mapping[str, Callable[[], object]],
    rounds: int = ROUNDS,
    warm_up: int = WARM_UP,
    progress: Callable[[Iterable[int], str, int], Iterator[int]] = without_progress,
    what: str = "",
) -> Timings:
    """Time variants interleaved, A B C A B C, so that a slow minute of the machine meets them all.

    Args:
        variants: each does its work and waits until it is done.
        rounds: timed runs of each.
        warm_up: rounds before, not timed: shaders compile at their first use.
        progress: iterates over all rounds and may show a bar.
        what: description of the rounds.
    """
    seconds = {name: np.empty(rounds) for name in variants}
    processor_seconds = {name: np.empty(rounds) for name in variants}
    for index in progress(range(-warm_up, rounds), what, warm_up + rounds):
        for name, work in variants.items():
            start, busy = time.perf_counter(), time.process_time()
            work()
            if index >= 0:
                seconds[name][index] = time.perf_counter() - start
                processor_seconds[name][index] = time.process_time() - busy
    return Timings(seconds, processor_seconds)


def _median_interval(values: NDArray[np.float64]) -> MedianInterval:
    values = np.sort(values)
    outer = _outer(len(values))
    return MedianInterval(float(np.median(values)), float(values[outer]), float(values[-1 - outer]))


def _outer(count: int) -> int:
    """Number of sorted values to leave out at either end for a median's interval.

    The true median is left of k values with a binomial probability, whatever the distribution.
    """
    tail, left_out = 0.0, 0
    for k in range(count // 2):
        tail += math.comb(count, k) * 0.5**count
        if 2.0 * tail > 1.0 - CONFIDENCE:
            break
        left_out = k
    return left_out
