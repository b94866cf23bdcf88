"""A town of any size, procedural: every house, tree and lamp has triangles of its own.

A larger town is a smaller one with more streets around it, equally detailed. Nothing is instanced,
so that a million triangles are a million triangles in memory, as in an exported file.
"""

from benchmarks.town.build import build_town

__all__ = ["build_town"]
