"""Foundations: errors, versions, poses, coordinate frames, the state of the world."""
