"""Baked light: lightmap for static surfaces, and irradiance probes for dynamic objects.

Light values are those of a white surface in display brightness, linear RGB: base color times light
is the color of a matte surface.
Source of the probes: Greger et al., "The irradiance volume", 1998.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from omnisim.core.arrays import Bools, Floats, Floats32
from omnisim.core.short_repr import short_repr
from omnisim.scene.light.environment import spherical_harmonics

MAX_HALF = 65504.0  # largest half float
# Weight of a probe inside a wall, which takes its neighbors' light: small next to a valid probe.
_FILLED_WEIGHT = 1.0 / 64.0
FACTORS = 9  # spherical harmonics up to order 2
_NEIGHBORS = [(x, y, z) for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1)]


@dataclass(frozen=True, eq=False)
class Probes:
    """Irradiance probes on a regular grid."""

    origin_m: Floats  # (3,) position of the first probe, world frame
    spacing_m: Floats  # (3,) distances between probes
    # (nx, ny, nz, 9, 3) float32 coefficients of the polynomials in
    # `environment.spherical_harmonics`
    factors: Floats32
    valid: Bools  # (nx, ny, nz) mask of the probes outside walls

    def __repr__(self) -> str:
        return short_repr(self, " × ".join(map(str, self.valid.shape)))

    @cached_property
    def texels(self) -> NDArray[np.float16]:
        """Weighted coefficients and weights (nx, ny, nz, 28), for linear filtering as on a GPU."""
        factors, known = self.factors.astype(np.float32), self.valid
        weights = np.where(known, 1.0, _FILLED_WEIGHT).astype(np.float32)
        while known.any() and not known.all():
            factors, known = _grown(factors, known)
        flat = factors.reshape(*known.shape, 3 * FACTORS)
        texels = np.concatenate((flat * weights[..., None], weights[..., None]), axis=-1)
        return np.clip(texels, -MAX_HALF, MAX_HALF).astype(np.float16)

    def light(self, points_m: NDArray[np.floating], normals: NDArray[np.floating]) -> Floats32:
        """Light (n, 3) on white surfaces at points (n, 3), world frame, with unit normals (n, 3).

        Twin of shaders/scene/baked_light.glsl.
        """
        sizes = np.array(self.valid.shape)
        places = np.clip((points_m - self.origin_m) / self.spacing_m, 0.0, sizes - 1)
        first = np.minimum(np.floor(places).astype(np.intp), np.maximum(sizes - 2, 0))
        shares = (places - first).astype(np.float32)
        total = np.zeros((len(places), self.texels.shape[-1]), dtype=np.float32)
        for corner in np.ndindex(2, 2, 2):
            at = np.minimum(first + corner, sizes - 1)
            weights = np.where(corner, shares, 1.0 - shares).prod(axis=1, dtype=np.float32)
            total += weights[:, None] * self.texels[at[:, 0], at[:, 1], at[:, 2]]
        factors = total[:, :-1].reshape(-1, FACTORS, 3) / total[:, -1, None, None]
        shares = spherical_harmonics(normals).astype(np.float32)
        light: Floats32 = np.einsum("nk,nkc->nc", shares, factors)
        return np.maximum(light, np.float32(0.0), out=light)


@dataclass(frozen=True, eq=False)
class BakedLight:
    """Baked light of a scene, including shadows and bounces."""

    # (height, width, 3) float16 lightmap, top row first, with a region per instance
    irradiance: NDArray[np.float16]
    probes: Probes  # light of surfaces without a region

    def __repr__(self) -> str:
        height, width = self.irradiance.shape[:2]
        return short_repr(self, f"{width} × {height} px", repr(self.probes))

    def light(self, uv: NDArray[np.floating]) -> Floats32:
        """Light (n, 3) at lightmap coordinates (n, 2), with (0, 0) at the top left."""
        height, width = self.irradiance.shape[:2]
        at = np.clip(uv * (width, height) - 0.5, 0.0, (width - 1, height - 1))
        first = np.minimum(np.floor(at).astype(np.intp), (max(width - 2, 0), max(height - 2, 0)))
        shares = (at - first).astype(np.float32)
        total = np.zeros((len(uv), 3), dtype=np.float32)
        for down, right in np.ndindex(2, 2):
            rows = np.minimum(first[:, 1] + down, height - 1)
            columns = np.minimum(first[:, 0] + right, width - 1)
            weights = np.where((right, down), shares, 1.0 - shares).prod(axis=1, dtype=np.float32)
            total += weights[:, None] * self.irradiance[rows, columns]
        return total


def _grown(factors: Floats32, known: Bools) -> tuple[Floats32, Bools]:
    """Coefficients and mask of probes, grown by one cell: new ones are means of valid neighbors."""
    padding = [(1, 1)] * 3
    padded = np.pad(np.where(known[..., None, None], factors, 0.0), [*padding, (0, 0), (0, 0)])
    counted = np.pad(known.astype(np.float32), padding)
    total, count = np.zeros_like(factors), np.zeros(known.shape, dtype=np.float32)
    for shift in _NEIGHBORS:
        part = tuple(
            slice(1 + step, 1 + step + size) for step, size in zip(shift, known.shape, strict=True)
        )
        total += padded[part]
        count += counted[part]
    mean = total / np.maximum(count, 1.0)[..., None, None]
    return np.where(known[..., None, None], factors, mean), known | (count > 0.0)
