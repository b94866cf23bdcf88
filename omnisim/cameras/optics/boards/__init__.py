"""Calibration of optical systems from pictures of boards."""
