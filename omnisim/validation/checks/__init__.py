"""Checks of the geometry, one module each."""
