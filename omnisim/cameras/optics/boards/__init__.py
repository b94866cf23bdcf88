"""Calibration of optical systems from images of boards."""
