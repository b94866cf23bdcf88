"""How a suite is run: the same options for all of them."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field

from benchmarks.errors import BenchmarkError
from benchmarks.timer import ROUNDS, WARM_UP, silently

# Goes along steps, says what they are for, and how many there are.
Progress = Callable[[Iterable[int], str, int], Iterator[int]]
FEWEST_ROUNDS, FEWEST_TO_WARM_UP = 6, 2  # six are the fewest whose extremes hold a median at 95 %


@dataclass(frozen=True)
class Options:
    """How often, where and in which scenes.

    Attributes:
        rounds: timed turns of each variant.
        warm_up: turns before, not timed.
        device: EGL's number of the GPU, as `omnisim info` lists them; None takes the first.
        scenes: names of built-in scenes, or files; none: the suite's own choice.
        progress: goes along the turns and may show how far it is.

    Raises:
        BenchmarkError: a number that cannot be.
    """

    rounds: int = ROUNDS
    warm_up: int = WARM_UP
    device: int | None = None
    scenes: tuple[str, ...] = ()
    progress: Progress = field(default=silently, compare=False)

    def __post_init__(self) -> None:
        if self.rounds < 1:
            raise BenchmarkError(f"--rounds {self.rounds}: want at least 1")
        if self.warm_up < 0:
            raise BenchmarkError(f"--warm-up {self.warm_up}: want 0 or more")
        if self.device is not None and self.device < 0:
            raise BenchmarkError(f"--device {self.device}: want 0 or more, see `omnisim info`")

    def fewer(self, times: int) -> Options:
        """So many times fewer turns, for variants that take long; never more than there were."""
        return dataclasses.replace(
            self,
            rounds=min(self.rounds, max(FEWEST_ROUNDS, self.rounds // times)),
            warm_up=min(self.warm_up, max(FEWEST_TO_WARM_UP, self.warm_up // times)),
        )
