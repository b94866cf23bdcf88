"""Distributions of a plan's numbers, drawn from streams that depend only on seed and image.

| in the file | drawn |
| --- | --- |
| `1.5` | always this number |
| `[0.2, 1.0]` | uniformly between the two |
| `{ normal = [0.0, 2.0] }` | normally: mean, standard deviation |
| `{ log_uniform = [0.1, 10.0] }` | uniformly in the logarithm |
| `{ choice = [0.0, 90.0, 180.0] }` | one of them |

Only uniform numbers are taken from NumPy's generator, and all others are computed from them, so
that streams do not change with NumPy's own distributions.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Literal, Protocol, TypeVar

import numpy as np
import scipy  # its submodules load when first used
from pydantic import AfterValidator, PlainValidator

from omnisim.core.files.parameters import MAX_NUMBER

Kind = Literal["constant", "uniform", "normal", "log_uniform", "choice"]
T = TypeVar("T")

EXPECTED = (
    "a number, [low, high], { normal = [mean, deviation] }, { log_uniform = [low, high] } or "
    "{ choice = [...] }"
)
MAX_SEED = 2**63 - 1
_KEY = 0x6F6D6E6973696D  # separates these streams from others with the same seed
_STEP = 2.0**-53  # of the shares: keeps normal numbers finite


@dataclass(frozen=True)
class Distribution:
    """Distribution of a number."""

    kind: Kind
    numbers: tuple[float, ...]  # parameters, as in the file

    def __repr__(self) -> str:
        numbers = f"[{', '.join(map(str, self.numbers))}]"
        if self.kind == "constant":
            return str(self.numbers[0])
        return numbers if self.kind == "uniform" else f"{{ {self.kind} = {numbers} }}"

    def draw(self, stream: Shares) -> float:
        """Draw a number; every distribution takes exactly one share from the stream."""
        share = stream.share()
        if self.kind in ("constant", "choice"):
            return self.numbers[min(int(share * len(self.numbers)), len(self.numbers) - 1)]
        first, second = self.numbers
        if self.kind == "normal":
            return first + second * float(scipy.special.ndtri(min(max(share, _STEP), 1.0 - _STEP)))
        if self.kind == "log_uniform":
            return float(first * (second / first) ** share)
        return first + share * (second - first)

    @property
    def low(self) -> float:
        """Lowest possible number; −inf: unbounded."""
        return -math.inf if self.kind == "normal" and self.numbers[1] else min(self._ends)

    @property
    def high(self) -> float:
        """Highest possible number; inf: unbounded."""
        return math.inf if self.kind == "normal" and self.numbers[1] else max(self._ends)

    @property
    def _ends(self) -> tuple[float, ...]:
        """Numbers that limits apply to; of a normal distribution, only its mean."""
        return self.numbers[:1] if self.kind == "normal" else self.numbers


class Shares(Protocol):
    """Source of numbers in [0, 1)."""

    def share(self) -> float:
        """Next number."""


@dataclass(frozen=True)
class ConstantShares:
    """Source of one constant share; with a share near 0 or 1, a distribution yields an end."""

    value: float

    def share(self) -> float:
        """The constant share."""
        return self.value


class RandomStream:
    """Random numbers as a function of integers: seed, and up to three keys of at least 0."""

    def __init__(self, seed: int, *keys: int):
        # the lowest word counts blocks of numbers
        counter = np.array([0, *keys, *[0] * (3 - len(keys))], dtype=np.uint64)
        key = np.array([seed, _KEY], dtype=np.uint64)
        self._generator = np.random.Generator(np.random.Philox(key=key, counter=counter))

    def share(self) -> float:
        """Draw a number in [0, 1)."""
        return float(self._generator.random())

    def whole(self, count: int) -> int:
        """Draw an integer in [0, count)."""
        return min(int(self.share() * count), count - 1)

    def choose(self, items: Sequence[T], weights: Sequence[float] | None = None) -> T:
        """Draw an item with probabilities proportional to the weights; None: uniformly."""
        if weights is None:
            return items[self.whole(len(items))]
        ends = np.cumsum(weights)
        row = int(np.searchsorted(ends, self.share() * ends[-1], side="right"))
        return items[min(row, len(items) - 1)]


def _parse(value: Any) -> Distribution:
    if isinstance(value, Distribution):
        return value
    if isinstance(value, int | float) and not isinstance(value, bool):
        return _checked("constant", [value], 1)
    if isinstance(value, list | tuple):
        return _checked("uniform", value, 2)
    if isinstance(value, Mapping) and len(value) == 1:
        ((kind, numbers),) = value.items()
        if kind in ("uniform", "normal", "log_uniform"):
            return _checked(kind, numbers, 2)
        if kind == "choice":
            return _checked("choice", numbers, None)
    raise ValueError(f"expected {EXPECTED}, got {value!r}")


def _checked(kind: Kind, numbers: Any, count: int | None) -> Distribution:
    is_list = isinstance(numbers, list | tuple) and len(numbers) > 0
    if not is_list or not all(_is_number(number) for number in numbers):
        raise ValueError(f"expected {EXPECTED}, got {numbers!r}")
    if count is not None and len(numbers) != count:
        raise ValueError(f"{kind}: expected {count} numbers, got {len(numbers)}")
    values = tuple(map(float, numbers))
    if kind == "uniform" and values[0] > values[1]:
        raise ValueError(f"expected [low, high] in this order, got {list(numbers)}")
    if kind == "normal" and values[1] < 0.0:
        raise ValueError(f"normal: expected a deviation ≥ 0, got {values[1]:g}")
    if kind == "log_uniform" and not 0.0 < values[0] <= values[1]:
        raise ValueError(f"log_uniform: expected 0 < low ≤ high, got {list(numbers)}")
    return Distribution(kind, values)


def _is_number(value: Any) -> bool:
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    return is_number and abs(value) <= MAX_NUMBER  # also refuses NaN


Distributed = Annotated[Distribution, PlainValidator(_parse)]


def within(low: float, high: float) -> AfterValidator:
    """Validator for limits of all numbers of a distribution; of a normal one, for its mean only."""

    def check(value: Distribution) -> Distribution:
        if min(value._ends) < low or max(value._ends) > high:
            span = f"{low:g} to {high:g}" if high < MAX_NUMBER else f"numbers ≥ {low:g}"
            raise ValueError(f"expected {span}, got {value}")
        return value

    return AfterValidator(check)
