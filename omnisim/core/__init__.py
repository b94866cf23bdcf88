"""Foundations: errors, versions, poses, coordinate frames and the state of the world."""
