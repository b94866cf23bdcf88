"""Mean of a measure over seeds, with its confidence interval."""

from __future__ import annotations

import math
import statistics
from collections.abc import Sequence
from typing import NamedTuple

import scipy  # its submodules load on first use

CONFIDENCE = 0.95


class SeedMean(NamedTuple):
    """Mean over seeds."""

    mean: float  # mean of the finite values; NaN: there are none
    # half of the mean's `CONFIDENCE` interval, by Student's t; NaN: fewer than two finite values
    half_width: float
    seeds: int  # number of finite values


def over_seeds(values: Sequence[float]) -> SeedMean:
    """Mean of the finite values among those of independent seeds."""
    known = [value for value in values if math.isfinite(value)]
    count = len(known)
    if count < 2:
        return SeedMean(known[0] if known else math.nan, math.nan, count)
    quantile = float(scipy.special.stdtrit(count - 1, 0.5 + 0.5 * CONFIDENCE))
    return SeedMean(
        statistics.fmean(known), quantile * statistics.stdev(known) / math.sqrt(count), count
    )
