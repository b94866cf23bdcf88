"""Calibration of optical systems from images of calibration boards."""
