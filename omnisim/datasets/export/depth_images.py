"""Depths as 16-bit images."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from omnisim.datasets.export.export_format import PrintNote

MAX_DEPTH = np.iinfo(np.uint16).max


class FarDepths:
    """Encoder of depths as integer steps, 0 for none; counts the depths that exceed its range.

    Args:
        camera: name of the camera, for the note.
        steps_per_m: steps per meter.
    """

    def __init__(self, camera: str, steps_per_m: float):
        self._camera, self._steps_per_m = camera, steps_per_m
        self._count = 0

    def encode(self, depths_m: NDArray[np.floating[Any]]) -> NDArray[np.uint16]:
        """Integer steps (height, width) of depths; +inf and depths out of range become 0."""
        steps = np.round(np.where(np.isfinite(depths_m), depths_m, 0.0) * self._steps_per_m)
        fits = (steps >= 0.0) & (steps <= MAX_DEPTH)
        self._count += int(np.count_nonzero(~fits))
        return np.where(fits, steps, 0.0).astype(np.uint16)

    def note(self, print_note: PrintNote) -> None:
        """Print a note with the number of depths out of range, if there are any."""
        if self._count:
            limit_m = MAX_DEPTH / self._steps_per_m
            print_note(f"{self._camera}: {self._count} depths past {limit_m:.1f} m are 0: none")
