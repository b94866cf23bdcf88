"""Motion blur and rolling shutter: exposure windows of the image's rows.

"auto" keeps a moving edge within 0.05 px of its true position in every row, and moves at most
0.5 px between sub-frames, with at most 64 sub-frames.

The pose of an image, and of its ground truth, is that of the middle of its frame: the middle row's
exposure. The frame lasts readout_s + exposure_s, first row first. This time is divided into equal
sub-frames, each rendered at the pose in its middle. A row averages the sub-frames, weighted by
their overlap with its exposure window. Without exposure, it is that of a single instant.

Source: Meingast, Geyer and Sastry, "Geometric models of rolling-shutter cameras", 2005.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from omnisim.core.arrays import Bools, Floats, Floats32
from omnisim.core.files.parameters import NotNegative, Positive, Typical, described
from omnisim.rendering.camera.degradations.effect import Effect

MAX_ERROR_PX = 0.05  # position error of a moving edge in a row
MAX_STEP_PX = 0.5  # motion between sub-frames: avoids ghosts
MAX_SUB_FRAMES = 64
MAX_S = 3600.0
SubFrames = Annotated[
    Literal["auto"] | Annotated[int, Field(strict=True, ge=1, le=4096)],
    described("a whole number from 1 to 4096 or 'auto'"),
]


@dataclass(frozen=True, kw_only=True)
class Shutter(Effect, name="degradation.shutter"):
    """Exposure of the rows, one by one or all at once."""

    exposure_s: Annotated[Positive, Field(le=MAX_S), Typical(0.001, 0.03)] | None = None
    """Exposure time of a row in seconds; left out: instantaneous."""
    readout_s: Annotated[NotNegative, Field(le=MAX_S)] = 0.0
    """Seconds from the start of the first row to that of the last; typically 0 (CCD) or 0.01 to
    0.03."""
    frame_rate_hz: Positive | None = None
    """Images per second, such as 15 or 30; limits the exposure to 1/rate; left out: unknown."""
    sub_frames: SubFrames = "auto"
    """Number of sub-frames per image; "auto": as its motion needs."""

    def _check(self) -> None:
        if self.frame_rate_hz is None:
            return
        period_s = 1.0 / self.frame_rate_hz
        for key in ("exposure_s", "readout_s"):
            value = getattr(self, key) or 0.0
            if value > period_s * (1.0 + 1e-9):
                period = f"{period_s:g} s, the time from image to image"
                at = f"at frame_rate_hz = {self.frame_rate_hz:g}"
                raise self._error(key, f"at most {period} {at}")

    @property
    def duration_s(self) -> float:
        """Time from the start of the first row to the end of the last."""
        return self.readout_s + (self.exposure_s or 0.0)

    def sub_frame_count(self, motion_px: float) -> int:
        """Number of sub-frames of an image in which edges move by `motion_px`."""
        if self.duration_s == 0.0 or motion_px == 0.0:
            return 1
        if self.sub_frames != "auto":
            return self.sub_frames
        # Without exposure an edge is off by half a step. With it, a row's part of a sub-frame is
        # off by at most half a step at either end: the mean of its window by step² / (8 exposure).
        blur_px = motion_px * (self.exposure_s or 0.0) / self.duration_s
        step_px = max(2.0 * MAX_ERROR_PX, math.sqrt(8.0 * MAX_ERROR_PX * blur_px))
        step_px = min(step_px, MAX_STEP_PX)
        return min(max(1, math.ceil(motion_px / step_px - 1e-9)), MAX_SUB_FRAMES)

    def times_s(self, count: int) -> Floats:
        """Midpoints (count,) of the sub-frames, relative to the middle of the frame."""
        return ((np.arange(count) + 0.5) / count - 0.5) * self.duration_s

    def row_weights(self, count: int, height_px: int) -> Floats32:
        """Shares (count, height) of each row's exposure in the sub-frames."""
        starts = np.linspace(0.0, self.readout_s, height_px)
        step_s = self.duration_s / count
        if self.exposure_s is None:
            indices = np.clip(np.floor(starts / step_s), 0, count - 1)
            is_taken: Bools = indices == np.arange(count)[:, None]
            return is_taken.astype(np.float32)
        begin = np.arange(count)[:, None] * step_s
        overlap = np.minimum(begin + step_s, starts + self.exposure_s) - np.maximum(begin, starts)
        overlap = np.maximum(overlap, 0.0)
        return (overlap / overlap.sum(axis=0)).astype(np.float32)
