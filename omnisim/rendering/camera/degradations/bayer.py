"""Bayer mosaic, one color per pixel, and demosaicing, which interpolates the others.

Source: Bayer, US patent 3 971 065; Malvar, He and Cutler, "High-quality linear interpolation for
demosaicing of Bayer-patterned color images", ICASSP 2004.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from omnisim.core.arrays import Bools, Floats, Floats32, Indices
from omnisim.rendering.camera.degradations.effect import DEFAULT_SHOT, SensorEffect, Shot
from omnisim.rendering.camera.degradations.image_geometry import (
    EffectStep,
    ImageGeometry,
    LinearImage,
)

RED_XY = {"RGGB": (0, 0), "GRBG": (1, 0), "GBRG": (0, 1), "BGGR": (1, 1)}  # column, row
# Malvar's filters, in eighths: for green at red or blue; for red at green in red's row; for red
# at green in red's column (the filter before, transposed); for red at blue.
_CROSS = ((0, 0, -1, 0, 0), (0, 0, 2, 0, 0), (-1, 2, 4, 2, -1), (0, 0, 2, 0, 0), (0, 0, -1, 0, 0))
_ROW_FILTER = np.array(
    ((0, 0, 0.5, 0, 0), (0, -1, 0, -1, 0), (-1, 4, 5, 4, -1), (0, -1, 0, -1, 0), (0, 0, 0.5, 0, 0))
)
_CORNERS = (
    (0, 0, -1.5, 0, 0), (0, 2, 0, 2, 0), (-1.5, 0, 6, 0, -1.5), (0, 2, 0, 2, 0), (0, 0, -1.5, 0, 0),
)  # fmt: skip
# Offsets of the 13 pixels in these filters.
_SUPPORT = (
    *((right, down) for right in (-1, 0, 1) for down in (-1, 0, 1)),
    *((-2, 0), (2, 0), (0, -2), (0, 2)),
)


@dataclass(frozen=True)
class Bayer(SensorEffect, name="degradation.bayer"):
    """Mosaic of single colors, and their interpolation.

    Neighbors outside of the image or its mask are ignored. At the border, and where one of
    Malvar's 5 × 5 pixels is missing, the valid nearest pixels of the color are averaged.
    """

    pattern: Literal["RGGB", "BGGR", "GRBG", "GBRG"] = "RGGB"
    """Colors of the top left 2 × 2 pixels, row by row."""
    demosaic: Literal["malvar", "bilinear", "none"] = "malvar"
    """Interpolation of the other two colors; "none": a gray mosaic."""

    def steps(self, geometry: ImageGeometry, shot: Shot = DEFAULT_SHOT) -> list[EffectStep]:
        """Two GPU passes: the mosaic, in all three channels, and demosaicing."""
        red_xy, is_malvar = RED_XY[self.pattern], self.demosaic == "malvar"
        mosaic = EffectStep("bayer_mosaic", {"u_red_xy": red_xy})
        demosaic = EffectStep("bayer_demosaic", {"u_red_xy": red_xy, "u_malvar": is_malvar})
        return [mosaic] if self.demosaic == "none" else [mosaic, demosaic]

    def apply(
        self, image: LinearImage, geometry: ImageGeometry, shot: Shot = DEFAULT_SHOT
    ) -> LinearImage:
        """Reference in NumPy."""
        colors = self.colors(geometry)
        raw = np.take_along_axis(image[..., :3], colors[..., None], axis=-1)[..., 0]
        result = image.copy()
        result[..., :3] = raw[..., None]
        if self.demosaic == "none":
            return result
        valid = image[..., 3] > 0.5
        for color in range(3):
            result[..., color] = self._demosaicked(raw, colors, color, valid)
        result[~valid, :3] = raw[~valid, None]
        return result

    def colors(self, geometry: ImageGeometry) -> Indices:
        """Color index (height, width) of each pixel: 0 red, 1 green, 2 blue."""
        column, row = RED_XY[self.pattern]
        right = (np.arange(geometry.width_px)[None, :] + column) % 2
        down = (np.arange(geometry.height_px)[:, None] + row) % 2
        return right + down

    def _demosaicked(self, raw: Floats32, colors: Indices, color: int, valid: Bools) -> Floats32:
        known = colors == color
        near = valid & known
        total, count = np.zeros(raw.shape, np.float32), np.zeros(raw.shape, np.float32)
        # nearest pixels of a color: beside the pixel or, if none is, at its corners
        for offsets in (((0, -1), (-1, 0), (1, 0), (0, 1)), ((-1, -1), (1, -1), (-1, 1), (1, 1))):
            layer_total, layer = np.zeros(raw.shape, np.float32), np.zeros(raw.shape, np.float32)
            for right, down in offsets:
                layer_total += _neighbor(np.where(near, raw, np.float32(0.0)), right, down)
                layer += _neighbor(near.astype(np.float32), right, down)
            total = np.where(count > 0, total, layer_total)
            count = np.where(count > 0, count, layer)
        guess = np.where(count > 0, total / np.maximum(count, np.float32(1.0)), raw)
        if self.demosaic == "malvar":
            whole = np.ones(raw.shape, dtype=bool)
            for right, down in _SUPPORT:
                whole &= _neighbor(valid.astype(np.float32), right, down) > 0.5
            filtered = _filtered(raw, np.array(_CROSS))
            if color != 1:
                in_row, in_column = (
                    _filtered(raw, kernel) for kernel in (_ROW_FILTER, _ROW_FILTER.T)
                )
                green = np.where(np.any(known, axis=1)[:, None], in_row, in_column)
                filtered = np.where(colors == 1, green, _filtered(raw, np.array(_CORNERS)))
            guess = np.where(whole, filtered, guess)
        return np.where(known, raw, guess)


def _filtered(raw: Floats32, eighths: Floats) -> Floats32:
    """Image filtered by weights (5, 5) in eighths."""
    total = np.zeros(raw.shape, dtype=np.float32)
    for down in range(-2, 3):
        for right in range(-2, 3):
            weight = np.float32(eighths[down + 2, right + 2] / 8.0)
            if weight != 0.0:
                total += weight * _neighbor(raw, right, down)
    return total


def _neighbor(values: Floats32, right: int, down: int) -> Floats32:
    """Values at an offset from each pixel; 0 outside of the image."""
    padded = np.pad(values, 2)
    height, width = values.shape
    return padded[2 + down : 2 + down + height, 2 + right : 2 + right + width]
