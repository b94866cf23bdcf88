"""Reflections of the scene: planar mirrors and panes, and reflection probes."""
