"""Ways of a bake's rays at specular surfaces.

A ray takes one way at random: it ends on the surface's own patch, is mirrored, or passes. The
chances are in proportion to the shares of the light, so that the mean over rays is that of all
ways. The random numbers are hashes of the rays: they do not depend on the order of the work.
"""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from omnisim.core.random_numbers import pcg4d, uniform
from omnisim.rendering.baking.sampling import Floats

_ABOVE = 1e-3  # minimum cosine between a mirrored ray and the triangle's plane


class Way(IntEnum):
    """Way of a ray from a specular surface."""

    END = 0
    MIRRORED = 1
    PASSED = 2


class Ways(NamedTuple):
    """Ways on for rays (n,) from specular surfaces.

    Attributes:
        reflected, passed: (n, 3) shares of the light from each way, linear RGB.
        is_invisible: (n,) mask of the backs of single-sided panes, which only pass light.
        normals, planes: (n, 3) unit normals, interpolated and of the triangle, facing the rays.
    """

    reflected: Floats
    passed: Floats
    is_invisible: NDArray[np.bool_]
    normals: Floats
    planes: Floats

    def take(self, indices: NDArray[np.intp]) -> Ways:
        """The selected rays."""
        return Ways._make(values[indices] for values in self)


def chosen(ways: Ways, own: Floats, numbers: Floats) -> tuple[NDArray[np.int8], Floats]:
    """Ways (n,) at random, see `Way`, and the factors (n, 3) of their light.

    Args:
        ways: shares of the light from each way.
        own: (n,) shares of the rays that end, relative to those of the light from other ways.
        numbers: (n,) random numbers in (0, 1).
    """
    own = np.where(ways.is_invisible, np.float32(0.0), own)
    mirrored, passed = ways.reflected.mean(axis=1), ways.passed.mean(axis=1)
    total = own + mirrored + passed
    points = numbers * total
    way = np.full(len(total), Way.END, dtype=np.int8)
    way[points >= own] = Way.MIRRORED
    way[points >= own + mirrored] = Way.PASSED
    way[(way == Way.PASSED) & (passed <= 0.0)] = Way.MIRRORED  # rounding, or a black surface
    way[(way == Way.MIRRORED) & (mirrored <= 0.0)] = Way.END
    factors = np.ones((len(total), 3), dtype=np.float32)
    for which, shares, means in (
        (Way.MIRRORED, ways.reflected, mirrored),
        (Way.PASSED, ways.passed, passed),
    ):
        some = np.flatnonzero(way == which)
        factors[some] = shares[some] * (total[some] / means[some])[:, None]
    some = np.flatnonzero((way == Way.END) & (own > 0.0))
    factors[some] = (total[some] / own[some])[:, None]
    return way, factors


def onward(
    points_m: Floats,
    directions: Floats,
    ways: Ways,
    is_mirrored: NDArray[np.bool_],
    start_m: float,
) -> tuple[Floats, Floats]:
    """Origins and directions (n, 3) of rays from specular surfaces, mirrored or straight on.

    Args:
        points_m, directions: (n, 3) hit points, and unit directions of the arriving rays.
        ways: normals of the surfaces.
        is_mirrored: (n,) mask; the other rays pass.
        start_m: offset of the origins from the surfaces.
    """
    along = np.einsum("nc,nc->n", directions, ways.normals)
    turned = directions - 2.0 * along[:, None] * ways.normals
    below = np.maximum(_ABOVE - np.einsum("nc,nc->n", turned, ways.planes), 0.0)
    turned += below[:, None] * ways.planes  # interpolated normals may reflect into the surface
    turned /= np.linalg.norm(turned, axis=1, keepdims=True)
    away_m = np.where(is_mirrored, np.float32(start_m), np.float32(-start_m))
    origins_m = points_m + away_m[:, None] * ways.planes
    aims = np.where(is_mirrored[:, None], turned, directions)
    return origins_m.astype(np.float32), aims.astype(np.float32)


def random_numbers(origins_m: Floats, directions: Floats, number: int) -> Floats:
    """Random numbers (n,) in (0, 1) for rays (n, 3), hashes of their bits and a number."""
    (x, y, z), (u, v, w) = (
        np.ascontiguousarray(values, dtype=np.float32).view(np.uint32).reshape(-1, 3).T
        for values in (origins_m, directions)
    )
    one, two, three, four = pcg4d(x, y, z, number)
    return uniform(pcg4d(one ^ u, two ^ v, three ^ w, four)[0])
