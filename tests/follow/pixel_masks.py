"""Masks of pixels for comparisons with rays of other ray casters."""

import numpy as np


def is_inside(ids):
    """True (height, width) where a pixel and its four neighbors have the same ID."""
    inside = np.zeros(ids.shape, bool)
    middle = ids[1:-1, 1:-1]
    near = (ids[:-2, 1:-1], ids[2:, 1:-1], ids[1:-1, :-2], ids[1:-1, 2:])
    inside[1:-1, 1:-1] = np.all([one == middle for one in near], axis=0)
    return inside
