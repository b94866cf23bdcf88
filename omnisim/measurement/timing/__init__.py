"""Readout and exposure of a camera, from images under a flickering lamp."""

from omnisim.measurement.timing.flicker import MeasuredTiming, line_profiles, measure_timing

__all__ = ["MeasuredTiming", "line_profiles", "measure_timing"]
