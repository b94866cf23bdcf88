"""Timer of all suites: interleaved variants in one process, with confidence intervals of ratios."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

WARM_UP = 20
ROUNDS = 30
MIN_ROUNDS = 6  # the fewest whose extremes contain the median at 95 %
CONFIDENCE = 0.95


@dataclass(frozen=True)
class MedianInterval:
    """Median over the rounds, and its confidence interval.

    Attributes:
        median: median over the rounds.
        low, high: interval that contains the true median with at least 95 % probability; requires
            six rounds.
    """

    median: float
    low: float
    high: float

    def flat(self, name: str) -> dict[str, float]:
        """Columns for a row of a report: `name`, `name_low` and `name_high`."""
        return {name: self.median, f"{name}_low": self.low, f"{name}_high": self.high}


@dataclass(frozen=True, eq=False)
class Timings:
    """Seconds of every round, by variant; ratios pair two variants of the same round.

    Attributes:
        seconds: wall-clock time.
        processor_seconds: processor time of all threads of this process, which other processes
            hardly change. It includes all work of a software renderer; with a GPU, only that of
            Python and the driver.
    """

    seconds: dict[str, NDArray[np.float64]]
    processor_seconds: dict[str, NDArray[np.float64]]

    def percentile_ms(self, variant: str, percent: float) -> float:
        """Percentile of the rounds in milliseconds."""
        return 1e3 * float(np.percentile(self.seconds[variant], percent))

    def cheapest(self) -> str:
        """Variant with the smallest median time, relative to each round's mean."""
        of_round = np.mean(list(self.seconds.values()), axis=0)
        return min(self.seconds, key=lambda name: float(np.median(self.seconds[name] / of_round)))

    def row(self, variant: str) -> dict[str, float]:
        """Columns of a report for one variant."""
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
    max_seconds: float = math.inf,
) -> Timings:
    """Time variants interleaved, A B C A B C, so that a slow minute affects them all.

    Args:
        variants: functions by name; each returns when its work is done.
        rounds: number of timed runs of each variant.
        warm_up: number of rounds before the timed ones: shaders compile at their first use.
        progress: iterates over all rounds, and may show a progress bar.
        what: description of the rounds.
        max_seconds: time after which no further round begins, warm-up included; at least
            `MIN_ROUNDS` rounds are timed.
    """
    begin = time.perf_counter()
    seconds = {name: np.empty(rounds) for name in variants}
    processor_seconds = {name: np.empty(rounds) for name in variants}
    for index in progress(range(-warm_up, rounds), what, warm_up + rounds):
        for name, work in variants.items():
            start, busy = time.perf_counter(), time.process_time()
            work()
            if index >= 0:
                seconds[name][index] = time.perf_counter() - start
                processor_seconds[name][index] = time.process_time() - busy
        if index + 1 >= MIN_ROUNDS and time.perf_counter() - begin > max_seconds:
            rounds = index + 1
            break
    return Timings(
        {name: values[:rounds] for name, values in seconds.items()},
        {name: values[:rounds] for name, values in processor_seconds.items()},
    )


def _median_interval(values: NDArray[np.float64]) -> MedianInterval:
    values = np.sort(values)
    outer = _outer(len(values))
    return MedianInterval(float(np.median(values)), float(values[outer]), float(values[-1 - outer]))


def _outer(count: int) -> int:
    """Number of sorted values to exclude at each end for a confidence interval of the median.

    The number of values below the true median is binomially distributed, for any distribution.
    """
    tail, left_out = 0.0, 0
    for k in range(count // 2):
        tail += math.comb(count, k) * 0.5**count
        if 2.0 * tail > 1.0 - CONFIDENCE:
            break
        left_out = k
    return left_out
