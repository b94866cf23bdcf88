"""Seeds, measurement numbers and rounding steps of range-measuring devices."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from omnisim.core.errors import OpticsError

MAX_SEED = 2**32 - 1  # one word of a NumPy seed, so that sequences of words are unique


def check_number(name: str, number: object) -> None:
    """Refuse a measurement number that is not a whole number of 32 bits.

    Raises:
        OpticsError: the message names it.
    """
    is_whole = isinstance(number, int | np.integer) and not isinstance(number, bool)
    if not (is_whole and 0 <= number <= MAX_SEED):  # type: ignore[operator]
        raise OpticsError(f"{name}: expected a whole number of 32 bits, got {number!r}")


def rounded(ranges_m: NDArray[np.float64], step_m: float) -> NDArray[np.float64]:
    """Ranges rounded to multiples of a step; 0: unchanged."""
    if not step_m:
        return ranges_m
    # a division, not a product: 8190 steps are then 8.19 to the last bit
    steps_per_m = 1.0 / step_m
    steps: NDArray[np.float64] = np.rint(ranges_m * steps_per_m) / steps_per_m
    return steps
