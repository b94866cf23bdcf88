"""Options shared by all suites."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field

from benchmarks.errors import BenchmarkError
from benchmarks.timer import MIN_ROUNDS, ROUNDS, WARM_UP, without_progress

# Iterates over steps, given a description and their number.
Progress = Callable[[Iterable[int], str, int], Iterator[int]]
MIN_TO_WARM_UP = 2


@dataclass(frozen=True)
class Options:
    """Number of rounds, GPU and scenes.

    Attributes:
        rounds: timed runs of each variant.
        warm_up: rounds before the timed ones.
        device: EGL index of the GPU, as `omnisim info` lists them; None: the first.
        scenes: names of built-in scenes, or files; empty: the suite's own choice.
        is_full: everything that a suite can measure, without a limit of time.
        progress: iterates over the rounds, and may show a progress bar.

    Raises:
        BenchmarkError: a number out of range.
    """

    rounds: int = ROUNDS
    warm_up: int = WARM_UP
    device: int | None = None
    scenes: tuple[str, ...] = ()
    is_full: bool = False
    progress: Progress = field(default=without_progress, compare=False)

    def __post_init__(self) -> None:
        if self.rounds < 1:
            raise BenchmarkError(f"--rounds: expected at least 1, got {self.rounds}")
        if self.warm_up < 0:
            raise BenchmarkError(f"--warm-up: expected 0 or more, got {self.warm_up}")
        if self.device is not None and self.device < 0:
            raise BenchmarkError(
                f"--device: expected 0 or more, got {self.device}; see `omnisim info`"
            )

    def fewer(self, times: int) -> Options:
        """Options with the number of rounds divided by `times`, for slow variants."""
        return dataclasses.replace(
            self,
            rounds=min(self.rounds, max(MIN_ROUNDS, self.rounds // times)),
            warm_up=min(self.warm_up, max(MIN_TO_WARM_UP, self.warm_up // times)),
        )
