"""Planar laser scanners."""
