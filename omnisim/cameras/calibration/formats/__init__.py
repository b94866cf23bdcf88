"""Calibration files of other tools: a module a format, a subclass of `Format` in each.

`omnisim.cameras.calibration.calibration_formats` lists them; the README has how to add one.
"""
