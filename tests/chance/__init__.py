"""Scenes by chance: random rooms, lenses, optical systems and lidars, by both back ends.

Own rays, cast by Embree and computed in float64, say what each pixel and each beam meets.
"""
