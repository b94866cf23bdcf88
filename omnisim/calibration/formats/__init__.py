"""Calibration files of other tools: a module a format, a subclass of `Format` in each.

`omnisim.calibration.registry` lists them; the README has how to add one.
"""
