"""Noise of a camera, from dark frames and flat fields by exposure (EMVA 1288)."""

from omnisim.measurement.noise.frame_statistics import (
    FrameSet,
    FrameStatistics,
    find_frame_sets,
    frame_statistics,
    read_statistics,
)
from omnisim.measurement.noise.measured_noise import MeasuredNoise, measure_noise

__all__ = [
    "FrameSet", "FrameStatistics", "MeasuredNoise", "find_frame_sets", "frame_statistics",
    "measure_noise", "read_statistics",
]  # fmt: skip
