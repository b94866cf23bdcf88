"""Checks of images against a path tracer."""
