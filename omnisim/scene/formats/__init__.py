"""Formats of scenes, a folder each."""
