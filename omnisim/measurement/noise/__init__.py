"""Noise of a camera, from dark frames and flat fields by exposure (EMVA 1288)."""

from omnisim.measurement.noise.frame_sets import FrameSet, find_frame_sets, read_statistics
from omnisim.measurement.noise.frame_statistics import FrameStatistics, frame_statistics
from omnisim.measurement.noise.measured_noise import MeasuredNoise, measure_noise

__all__ = [
    "FrameSet",
    "FrameStatistics",
    "MeasuredNoise",
    "find_frame_sets",
    "frame_statistics",
    "measure_noise",
    "read_statistics",
]
