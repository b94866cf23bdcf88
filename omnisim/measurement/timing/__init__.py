"""Readout and exposure of a camera, from images under a flickering lamp or of a turning board."""

from omnisim.measurement.timing.flicker import (
    MeasuredReadout,
    MeasuredTiming,
    line_profiles,
    measure_readout,
    measure_timing,
)

__all__ = [
    "MeasuredReadout", "MeasuredTiming", "line_profiles", "measure_readout", "measure_timing",
]  # fmt: skip
