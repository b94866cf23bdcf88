"""Unwarping: resampling of one camera's image for another camera at the same viewpoint.

The table of a pair of cameras and a rotation is computed once and applied to any number of images.
Colors are blended in linear light.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from omnisim.cameras import CentralCamera, check_central, pixel_grid
from omnisim.core.bilinear import corner_and_weights
from omnisim.core.errors import OpticsError
from omnisim.core.srgb import linear_from_srgb8, srgb8_from_linear

MAX_SAMPLES = 8  # per side of a view's pixel
# A view is computed in blocks of rows, which bounds intermediate memory at 24 bytes per sample.
BLOCK_SAMPLES = 1 << 21
MAX_KEPT_SAMPLES = 1 << 24
_STEPS = 65535  # linear steps of 1/65535 are finer than any step of 8-bit sRGB
_SRGB = srgb8_from_linear(np.arange(_STEPS + 1) / _STEPS)


class _RowBlock(NamedTuple):
    """Rows of a view, with the lookups of their pixels in the image."""

    rows: slice
    valid: NDArray[np.bool_]  # (rows, width)
    lookups: list[tuple[NDArray[np.intp], NDArray[np.float32]]]  # per sample: corner, weights


class Unwarping:
    """Remap table from the pixels of a view to an image.

    The table of a very large view is not kept but recomputed for each image.

    A pixel of the view is valid if the image shows all its samples.

    Args:
        camera: camera of the image.
        view: camera of the view, at the same effective viewpoint.
        camera_from_view: (3, 3) rotation between their optical frames.
        covered: (height, width) pixels of the image that show the scene; None: the model's valid
            pixels.
        samples: number of averaged samples per side of a view's pixel; None: so many that no pixel
            of the image is skipped, up to `MAX_SAMPLES`.

    Attributes:
        valid: (height, width) pixels of the view that show the scene.

    Raises:
        OpticsError: the image shows nothing of the view, or its camera is non-central.
    """

    def __init__(
        self,
        camera: CentralCamera,
        view: CentralCamera,
        camera_from_view: ArrayLike,
        covered: NDArray[np.bool_] | None = None,
        samples: int | None = None,
    ):
        check_central(camera, "unwarping")
        self._camera, self._view = camera, view
        self._rotation = np.asarray(camera_from_view, dtype=np.float64)
        self._shape = (camera.height_px, camera.width_px)
        if covered is None:
            covered = camera.ray_from_pixel(pixel_grid(camera.width_px, camera.height_px)).valid
        self._covered = covered
        if samples is None:
            samples = _samples_needed(camera, view, self._rotation)
        self._samples = samples
        self.valid = np.zeros((view.height_px, view.width_px), dtype=bool)
        self._kept: list[_RowBlock] | None = []
        if self.valid.size * samples**2 > MAX_KEPT_SAMPLES:
            self._kept = None
        for block in self._make_blocks():
            self.valid[block.rows] = block.valid
            if self._kept is not None:
                self._kept.append(block)
        if not self.valid.any():
            raise OpticsError("the image shows nothing of this view")

    def __call__(self, image: NDArray[Any]) -> NDArray[Any]:
        """Unwarp an image (height, width, channels), uint8 sRGB or linear floats.

        Returns the view in the same type; 0 where it is not `valid`.

        Raises:
            OpticsError: the image does not have the camera's size.
        """
        if image.shape[:2] != self._shape:
            raise OpticsError(
                f"an image of {image.shape[1]} × {image.shape[0]} px, where the camera's has "
                f"{self._shape[1]} × {self._shape[0]}"
            )
        is_encoded = image.dtype == np.uint8
        linear = linear_from_srgb8(image) if is_encoded else image.astype(np.float32, copy=False)
        flat = linear.reshape(-1, image.shape[2])
        result = np.zeros((*self.valid.shape, image.shape[2]), dtype=image.dtype)
        width = self._shape[1]
        for rows, valid, lookups in self._make_blocks() if self._kept is None else self._kept:
            total = np.zeros((*valid.shape, image.shape[2]), dtype=np.float32)
            with np.errstate(over="ignore"):  # light beyond a float's range is infinite
                for corner, weights in lookups:
                    for step, weight in zip((0, 1, width, width + 1), weights, strict=True):
                        total += weight[..., None] * flat.take(corner + step, axis=0, mode="clip")
            seen = total[valid] / np.float32(len(lookups))
            result[rows][valid] = _encode(seen) if is_encoded else seen
        return result

    def _make_blocks(self) -> Iterator[_RowBlock]:
        """Yield all rows of the view in blocks, from top to bottom."""
        height, width = self.valid.shape
        offsets = (np.arange(self._samples) + 0.5) / self._samples - 0.5
        step = max(1, BLOCK_SAMPLES // (width * self._samples**2))
        for first in range(0, height, step):
            rows = slice(first, min(first + step, height))
            grid = pixel_grid(width, rows.stop - first) + (0.0, first)
            valid = np.ones(grid.shape[:2], dtype=bool)
            lookups = []
            for down in offsets:
                for right in offsets:
                    corner, weights, seen = self._look_up(grid + (right, down))
                    valid &= seen
                    lookups.append((corner, weights))
            yield _RowBlock(rows, valid, lookups)

    def _look_up(
        self, positions_px: NDArray[np.float64]
    ) -> tuple[NDArray[np.intp], NDArray[np.float32], NDArray[np.bool_]]:
        """Bilinear lookups in the image for positions (h, w, 2) in the view.

        Indices (h, w) of the top left pixels, weights (4, h, w) of the four pixels, and a mask
        (h, w) of the positions that the image shows.
        """
        rays = self._view.ray_from_pixel(positions_px)
        pixels = self._camera.pixel_from_ray(rays.directions @ self._rotation.T)
        corner, weights, inside = corner_and_weights(pixels.positions_px, self._shape)
        for step in (0, 1, self._shape[1], self._shape[1] + 1):
            inside &= self._covered.take(corner + step, mode="clip")
        return corner, weights, inside & pixels.valid & rays.valid


def _encode(linear: NDArray[Any]) -> NDArray[np.uint8]:
    """Encode linear light as 8-bit sRGB."""
    return _SRGB[np.rint(np.clip(linear, 0.0, 1.0) * _STEPS).astype(np.int32)]


def _samples_needed(
    camera: CentralCamera, view: CentralCamera, camera_from_view: NDArray[np.float64]
) -> int:
    """Samples per side of a view's pixel that skip no pixel of the image, up to `MAX_SAMPLES`."""
    u = np.linspace(0.0, view.width_px - 1.0, min(view.width_px, 65))
    v = np.linspace(0.0, view.height_px - 1.0, min(view.height_px, 65))
    grid = np.stack(np.meshgrid(u, v), axis=-1)

    def pixels(step: tuple[float, float]) -> Any:
        return camera.pixel_from_ray(
            view.ray_from_pixel(grid + step).directions @ camera_from_view.T
        )

    center, right, down = pixels((0.0, 0.0)), pixels((0.5, 0.0)), pixels((0.0, 0.5))
    seen = center.valid & right.valid & down.valid
    if not seen.any():
        return 1
    steps = np.stack(
        (right.positions_px - center.positions_px, down.positions_px - center.positions_px)
    )
    longest = 2.0 * np.linalg.norm(steps, axis=-1)[:, seen].max()
    return int(min(MAX_SAMPLES, max(1, math.ceil(longest - 0.5))))
