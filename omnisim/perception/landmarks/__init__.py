"""Landmarks: colors, regions and their measurement."""
