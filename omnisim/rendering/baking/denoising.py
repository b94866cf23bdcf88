"""Noise filter of gathered light, among neighboring texels on one surface.

Texels are weighted by the similarity of their light relative to its noise, which two halves of the
rays estimate. Light of lamps has no noise and is not filtered, so shadows stay sharp. Neighbors in
the atlas that are apart in the world, or differ in orientation, have no weight: charts do not mix.
Source: Dammertz et al., "Edge-avoiding À-Trous wavelet transform for fast global illumination
filtering", 2010; Schied et al., "Spatiotemporal variance-guided filtering", 2017.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from omnisim.core.arrays import Bools, Floats32
from omnisim.rendering.baking.emitters import LUMINANCE
from omnisim.rendering.baking.patches import Patches

_STEPS = (1, 2, 4)  # texels between the samples of the filter
_KERNEL = (1.0, 2.0 / 3.0, 1.0 / 6.0)  # by distance, from a cubic B-spline
_ALIKE = 2.0  # similarity limit, standard deviations
_MIN_COSINE = 0.9
_PLANE_TEXELS, _NEAR_TEXELS = 0.5, 1.5  # distance off the plane; distance relative to the atlas
_BAND = 256  # rows per step


class TexelSurfaces(NamedTuple):
    """Surfaces at patches."""

    # (p, 3) position and normal
    positions_m: Floats32
    normals: Floats32
    is_valid: Bools  # (p,) the patch has light


class _Maps(NamedTuple):
    """Surfaces in the layout of the atlas, with a margin."""

    positions_m: Floats32
    normals: Floats32
    spacing_m: Floats32
    known: Bools


def denoised(
    patches: Patches, surfaces: TexelSurfaces, light: Floats32, halves: Floats32
) -> Floats32:
    """Light (p, 3) of patches with most noise removed, by `halves` (p, 2, 3) of the rays."""
    width, height = patches.size_px
    margin = 2 * max(_STEPS)
    some = np.flatnonzero(surfaces.is_valid & (patches.places < width * height))
    rows, columns = np.divmod(patches.atlas_places[some], width)
    at = rows + margin, columns + margin
    shape = height + 2 * margin, width + 2 * margin

    def spread(values: Floats32) -> Floats32:
        pixels = np.zeros((*shape, *values.shape[1:]), dtype=np.float32)
        pixels[at] = values[some]
        return pixels

    known = np.zeros(shape, dtype=np.bool_)
    known[at] = True
    maps = _Maps(
        spread(surfaces.positions_m), spread(surfaces.normals), spread(patches.spacing_m), known
    )
    spreads = (0.5 * (halves[:, 0] - halves[:, 1]) @ LUMINANCE).astype(np.float32)
    pixels, variances = spread(light), spread(spreads * spreads)
    variances = _filtered(maps, variances[..., None], None, 1, margin)[0][..., 0]
    for step in _STEPS:
        pixels, variances = _filtered(maps, pixels, variances, step, margin)
    result = light.copy()
    result[some] = pixels[at]
    return result


def _filtered(
    maps: _Maps, pixels: Floats32, variances: Floats32 | None, step: int, margin: int
) -> tuple[Floats32, Floats32]:
    """Means of pixels and their variances; without variances, light does not affect the weights."""
    means, new_variances = np.zeros_like(pixels), np.zeros(pixels.shape[:2], dtype=np.float32)
    height = len(pixels)
    for top in range(margin, height - margin, _BAND):
        rows = slice(top, min(top + _BAND, height - margin))
        inner = rows, slice(margin, pixels.shape[1] - margin)
        total = np.zeros_like(pixels[inner])
        weight_sum, squares = np.zeros((2, *total.shape[:2]), dtype=np.float32)
        for shifted, weight in _neighbors(maps, inner, step):
            if variances is not None:
                # by the difference of light relative to its noise
                off = np.abs((pixels[shifted] - pixels[inner]) @ LUMINANCE)
                noise = np.sqrt(variances[inner] + variances[shifted])
                weight = weight * np.exp(-off / (np.float32(_ALIKE) * noise + np.float32(1e-6)))
                squares += weight * weight * variances[shifted]
            total += weight[..., None] * pixels[shifted]
            weight_sum += weight
        weight_sum = np.maximum(weight_sum, np.float32(1e-12))
        means[inner] = total / weight_sum[..., None]
        new_variances[inner] = squares / (weight_sum * weight_sum)
    return means, new_variances


Place = tuple[slice, slice]


def _neighbors(maps: _Maps, inner: Place, step: int) -> Iterator[tuple[Place, Floats32]]:
    """Shifted places of 5 × 5 neighbors, and their weights by surface."""
    normals, positions = maps.normals[inner], maps.positions_m[inner]
    spacing = maps.spacing_m[inner]
    for down in range(-2, 3):
        for right in range(-2, 3):
            shifted = _moved(inner[0], down * step), _moved(inner[1], right * step)
            away = maps.positions_m[shifted] - positions
            off_plane = np.abs(np.einsum("ijc,ijc->ij", away, normals))
            reach = spacing * np.float32(step * np.hypot(down, right) * _NEAR_TEXELS + 1e-6)
            weight = maps.known[shifted] & (off_plane < _PLANE_TEXELS * spacing)
            weight &= np.einsum("ijc,ijc->ij", away, away) <= reach * reach
            alike = np.einsum("ijc,ijc->ij", maps.normals[shifted], normals)
            weight &= alike > _MIN_COSINE
            kernel = np.float32(_KERNEL[abs(down)] * _KERNEL[abs(right)])
            yield shifted, weight * kernel


def _moved(span: slice, by: int) -> slice:
    return slice(span.start + by, span.stop + by)
