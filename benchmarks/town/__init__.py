"""Procedural town of any size, with separate triangles for every house, tree and lamp.

A larger town is a smaller one with more, equally detailed streets around it. Nothing is instanced:
a million triangles are a million triangles in memory, as in an exported file.
"""

from benchmarks.town.build import build_town

__all__ = ["build_town"]
