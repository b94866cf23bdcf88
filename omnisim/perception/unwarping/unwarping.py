"""Unwarping: resampling of one camera's image for another camera at the same viewpoint.

The table of a pair of cameras and a rotation is computed once and applied to any number of images.
Colors are blended in linear light.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from omnisim.cameras import CentralCamera, check_central, period_px, pixel_grid
from omnisim.core.arrays import Bools, Floats, Floats32, Indices
from omnisim.core.bilinear import corner_and_weights
from omnisim.core.errors import OpticsError, OutputError
from omnisim.core.poses import check_pose
from omnisim.core.srgb import linear_from_srgb8, srgb8_from_linear
from omnisim.ground_truth.channels import CHANNELS, FLOWS

MAX_SAMPLES = 8  # per side of a view's pixel
# A view is computed in blocks of rows, which bounds intermediate memory at 24 bytes per sample.
BLOCK_SAMPLES = 1 << 21
MAX_KEPT_SAMPLES = 1 << 24
_STEPS = 65535  # linear steps of 1/65535 are finer than any step of 8-bit sRGB
_SRGB = srgb8_from_linear(np.arange(_STEPS + 1) / _STEPS)


class _RowBlock(NamedTuple):
    """Rows of a view, with the lookups of their pixels in the image."""

    rows: slice
    valid: Bools  # (rows, width)
    lookups: list[tuple[Indices, Floats32]]  # per sample: corner, weights


class Unwarping:
    """Remap table from the pixels of a view to an image.

    The table of a very large view is not kept but recomputed for each image. A pixel of the view is
    valid if the image shows all its samples.

    Args:
        camera, view: cameras of the image and of the view, at the same effective viewpoint.
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
        covered: Bools | None = None,
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
            seen: NDArray[Any] = total[valid] / np.float32(len(lookups))
            if is_encoded:  # as 8-bit sRGB
                seen = _SRGB[np.rint(np.clip(seen, 0.0, 1.0) * _STEPS).astype(np.int32)]
            result[rows][valid] = seen
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

    def _look_up(self, positions_px: Floats) -> tuple[Indices, Floats32, Bools]:
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


def _samples_needed(camera: CentralCamera, view: CentralCamera, camera_from_view: Floats) -> int:
    """Samples per side of a view's pixel that skip no pixel of the image, up to `MAX_SAMPLES`."""
    u = np.linspace(0.0, view.width_px - 1.0, min(view.width_px, 65))
    v = np.linspace(0.0, view.height_px - 1.0, min(view.height_px, 65))
    grid = np.stack(np.meshgrid(u, v), axis=-1)

    def pixels(step: tuple[float, float]) -> Any:
        directions = view.ray_from_pixel(grid + step).directions
        return camera.pixel_from_ray(directions @ camera_from_view.T)

    center, right, down = pixels((0.0, 0.0)), pixels((0.5, 0.0)), pixels((0.0, 0.5))
    seen = center.valid & right.valid & down.valid
    if not seen.any():
        return 1
    steps = np.stack([other.positions_px - center.positions_px for other in (right, down)])
    longest = 2.0 * np.linalg.norm(steps, axis=-1)[:, seen].max()
    return int(min(MAX_SAMPLES, max(1, math.ceil(longest - 0.5))))


# Unwarping of ground truth: channels of an image, resampled for a view.
#
# Values are not blended: a pixel of the view has the channels of the image's pixel nearest to its
# ray, so that no value is invented at a silhouette. If the view has finer pixels than the image,
# several of them have the channels of the same pixel.


_OUTSIDE = 2  # value of the occlusion channels
_DIRECTIONS = ("normals_camera", "scene_flow_camera")  # relative to the camera


class ChannelUnwarping:
    """Table of the image's pixel nearest to each ray of a view.

    Range remains the length of the ray; position, normals, scene flow, albedo, classes and
    instances are those of the image's pixel. Directions relative to the camera are rotated. `z` is
    computed from `position`. Both ends of the flow are projected into the view, as if the view were
    a camera on the same vehicle. Occlusion is that of the image, and 2 (outside) also where the
    point leaves the view.

    Args:
        camera, view: cameras of the image and of the view, at the same effective viewpoint.
        camera_from_view: (3, 3) rotation between their optical frames.
        covered: (height, width) pixels of the image with a ray; None: the camera's valid pixels.

    Attributes:
        valid: (height, width) pixels of the view with a value.

    Raises:
        OpticsError: the image shows nothing of the view, or its camera is non-central.
    """

    def __init__(
        self,
        camera: CentralCamera,
        view: CentralCamera,
        camera_from_view: ArrayLike,
        covered: Bools | None = None,
    ):
        check_central(camera, "unwarping")
        self._camera, self._view = camera, view
        self._camera_from_view = np.asarray(camera_from_view, dtype=np.float64)
        grid = pixel_grid(camera.width_px, camera.height_px)
        own_rays = camera.ray_from_pixel(grid)
        rays = view.ray_from_pixel(pixel_grid(view.width_px, view.height_px))
        pixels = camera.pixel_from_ray(rays.directions @ self._camera_from_view.T)
        nearest = np.rint(np.where(pixels.valid[..., None], pixels.positions_px, -1.0))
        column, row = np.moveaxis(nearest, -1, 0)
        inside = (column >= 0) & (column < camera.width_px) & (row >= 0) & (row < camera.height_px)
        self._nearest = np.where(inside, row * camera.width_px + column, 0).astype(np.intp)
        has_ray = own_rays.valid if covered is None else covered & own_rays.valid
        self.valid: Bools = rays.valid & pixels.valid & inside
        self.valid &= has_ray.take(self._nearest)
        if not self.valid.any():
            raise OpticsError("the image shows nothing of this view")

    def __call__(
        self, channels: Mapping[str, NDArray[Any]], world_from_view: ArrayLike | None = None
    ) -> dict[str, NDArray[Any]]:
        """Unwarp channels of a frame by name; `Channel.empty` where the view is not `valid`.

        `z` requires the pose (4, 4) of the view's optical frame.

        Raises:
            OutputError: `z` without `position` or the pose, or an array of another size.
        """
        flows = {
            name: self._flow(channels[name], occlusion, channels.get(occlusion))
            for name, occlusion in FLOWS.items()
            if name in channels
        }
        unwarped = {name: values for pair in flows.values() for name, values in pair.items()}
        width, height = self._camera.width_px, self._camera.height_px
        for name, values in channels.items():
            if values.shape[:2] != (height, width):
                raise OutputError(
                    f"channel {name!r}: expected {width} × {height} px, as its image, got "
                    f"{values.shape[1]} × {values.shape[0]}"
                )
            if name == "z":
                unwarped[name] = self._depths(channels, world_from_view)
            elif name not in unwarped:
                unwarped[name] = self._take(values)
            if name in _DIRECTIONS:
                unwarped[name] = unwarped[name] @ self._camera_from_view.astype(np.float32)
        if "valid" in unwarped:
            unwarped["valid"] = unwarped["valid"] & self.valid
        result = {name: unwarped[name].astype(CHANNELS[name].dtype) for name in channels}
        for name, values in result.items():
            values[~self.valid] = CHANNELS[name].empty
        return result

    def _take(self, values: NDArray[Any]) -> NDArray[Any]:
        flat = values.reshape(-1, *values.shape[2:])
        return flat.take(self._nearest, axis=0)

    def _depths(
        self, channels: Mapping[str, NDArray[Any]], world_from_view: ArrayLike | None
    ) -> NDArray[Any]:
        """Coordinates (height, width) in m along the view's z; +inf: no hit."""
        if "position" not in channels or world_from_view is None:
            raise OutputError(
                "channel 'z': expected position beside it, and the image's pose: it is along "
                "another axis in the view, and made of these"
            )
        pose = check_pose(world_from_view)
        depths_m = (self._take(channels["position"]) - pose[:3, 3]) @ pose[:3, 2]
        return np.where(np.isnan(depths_m), np.inf, depths_m)

    def _flow(
        self, flow_px: NDArray[Any], occlusion: str, occluded: NDArray[Any] | None
    ) -> dict[str, NDArray[Any]]:
        """Flow in pixels of the view, and its occlusion by name."""
        camera, view = self._camera, self._view
        starts_px = pixel_grid(camera.width_px, camera.height_px)
        ends_px = starts_px + np.nan_to_num(flow_px)
        start, end = (self._seen(self._take(positions)) for positions in (starts_px, ends_px))
        moved_px = end[0] - start[0]
        period = period_px(view)
        if period is not None:
            moved_px[..., 0] -= period * np.round(moved_px[..., 0] / period)
        known = start[1] & end[1] & np.isfinite(self._take(flow_px)).all(axis=-1)
        moved_px[~known] = np.nan
        result = {name: moved_px for name, pair in FLOWS.items() if pair == occlusion}
        if occluded is not None:
            u, v = np.moveaxis(end[0], -1, 0)
            inside = known & (u >= -0.5) & (u < view.width_px - 0.5)
            inside &= (v >= -0.5) & (v < view.height_px - 0.5)
            result[occlusion] = np.where(inside, self._take(occluded), np.uint8(_OUTSIDE))
        return result

    def _seen(self, positions_px: Floats) -> tuple[Floats, Bools]:
        """Positions (..., 2) in the view of positions in the image, px; a mask of the visible."""
        rays = self._camera.ray_from_pixel(positions_px)
        pixels = self._view.pixel_from_ray(rays.directions @ self._camera_from_view)
        return pixels.positions_px.copy(), rays.valid & pixels.valid
