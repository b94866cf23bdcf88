"""Calibrations of cameras: files of other tools in and out, and fits from one model to another."""
