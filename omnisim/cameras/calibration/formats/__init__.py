"""Calibration files of other tools: one module per format, each with a subclass of `Format`.

`omnisim.cameras.calibration.calibration_formats` lists them; the README explains how to add one.
"""
