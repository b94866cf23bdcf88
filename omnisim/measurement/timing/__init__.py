"""Readout and exposure of a camera, from images under a flickering lamp or of a turning board."""

from omnisim.measurement.timing.flicker import MeasuredTiming, line_profiles, measure_timing
from omnisim.measurement.timing.turning_board import MeasuredReadout, measure_readout

__all__ = [
    "MeasuredReadout", "MeasuredTiming", "line_profiles", "measure_readout", "measure_timing",
]  # fmt: skip
