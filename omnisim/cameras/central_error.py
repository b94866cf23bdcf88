"""Error of a central approximation of a non-central camera, by distance."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from omnisim.core.arrays import Bools, Floats


class CentralError(NamedTuple):
    """Error of a central approximation over an image, for points at one distance."""

    distance_m: float  # from the viewpoint; may be infinite
    mean_px: float
    median_px: float
    percentile_99_px: float
    max_px: float
    left_out: float  # share of the rays whose points the central model cannot see

    @property
    def at(self) -> str:
        """Distance as text."""
        return f"{self.distance_m:g} m" if math.isfinite(self.distance_m) else "infinity"

    def __str__(self) -> str:
        if math.isnan(self.percentile_99_px):
            return f"not shown at {self.at}"
        off_px = self.percentile_99_px
        return f"{'0.00' if off_px < 0.005 else f'{off_px:.2g}'} px at {self.at}"

    @classmethod
    def of(cls, distance_m: float, errors_px: Floats, valid: Bools) -> CentralError:
        """Statistics over the valid errors (n,) of points at a distance; NaN if none is valid."""
        seen = errors_px[valid]
        if len(seen) == 0:
            return cls(distance_m, math.nan, math.nan, math.nan, math.nan, 1.0)
        median, high = np.percentile(seen, (50.0, 99.0))
        left_out = float(1.0 - valid.mean())
        mean, most = float(seen.mean()), float(seen.max())
        return cls(distance_m, mean, float(median), float(high), most, left_out)
