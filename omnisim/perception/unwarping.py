"""Unwarping: resampling of one camera's image for another camera, a view, at the same viewpoint.

`Unwarping` resamples colors, blended in linear light, and `ChannelUnwarping` ground truth, each by
a table that is computed once for any number of images. Then follow the usual views, and `Panorama`,
the view in which landmarks are found.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from omnisim.cameras import (
    CentralCamera,
    CylindricalCamera,
    HyperbolicCamera,
    NonCentralCamera,
    PerspectiveCamera,
    check_central,
    period_px,
    pixel_grid,
)
from omnisim.cameras.mirrors.hyperbolic import theta_from_image_radius_eq2_rad
from omnisim.core.arrays import Bools, Floats, Floats32, Indices
from omnisim.core.bilinear import corner_and_weights
from omnisim.core.coordinate_frames import (
    BASE_FROM_OPTICAL_LOOKING_AHEAD,
    BASE_FROM_OPTICAL_LOOKING_DOWN,
    RIG_FROM_OPTICAL_LOOKING_UP,
)
from omnisim.core.errors import LocalizationError, OpticsError, OutputError
from omnisim.core.poses import check_pose, rotation_from_roll_pitch_yaw
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
        self._steps = 0, 1, camera.width_px, camera.width_px + 1  # from a corner to its four pixels
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
                f"image: expected the camera's {self._shape[1]} × {self._shape[0]} px, got "
                f"{image.shape[1]} × {image.shape[0]}"
            )
        is_encoded = image.dtype == np.uint8
        linear = linear_from_srgb8(image) if is_encoded else image.astype(np.float32, copy=False)
        flat = linear.reshape(-1, image.shape[2])
        result = np.zeros((*self.valid.shape, image.shape[2]), dtype=image.dtype)
        for rows, valid, lookups in self._make_blocks() if self._kept is None else self._kept:
            total = np.zeros((*valid.shape, image.shape[2]), dtype=np.float32)
            with np.errstate(over="ignore"):  # light beyond a float's range is infinite
                for corner, weights in lookups:
                    for step, weight in zip(self._steps, weights, strict=True):
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
        for step in self._steps:
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
                "channel 'z': requires the channel position and the image's pose, from which "
                "depths along the view's axis are computed"
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


# Views to unwarp an omnidirectional image to: cylinder, perspective, bird's eye.
#
# Each view is a camera at the effective viewpoint of the image, with an orientation on the vehicle.
# The bird's eye view is a perspective view straight down, in which plane ground appears as a map.


STEEPEST_RAD = math.radians(85.0)  # of a cylinder's rows: at 90° they are infinitely far away


@dataclass(frozen=True, eq=False)
class View:
    """Camera at the effective viewpoint, and its (3, 3) rotation to the vehicle's base."""

    camera: CentralCamera
    base_from_view: Floats


def cylinder_view(
    width_px: int, lowest_rad: float, highest_rad: float, yaw_rad: float = 0.0
) -> View:
    """Cylindrical view of a whole turn of `width_px`, left to right clockwise.

    The middle column looks toward `yaw_rad`, counter-clockwise from the vehicle's front, the left
    and right edges back; elevations are of the lowest and highest row above the horizon.

    Raises:
        OpticsError: elevations that leave no row between them, or are too steep for a cylinder.
    """
    if not -STEEPEST_RAD <= lowest_rad < highest_rad <= STEEPEST_RAD:
        raise OpticsError(
            f"cylinder: elevation {math.degrees(lowest_rad):g}° to {math.degrees(highest_rad):g}°: "
            f"expected the lower one first, within ±{math.degrees(STEEPEST_RAD):g}°"
        )
    focal_length_px = width_px / (2.0 * math.pi)
    top_px = focal_length_px * math.tan(highest_rad)
    height_px = max(1, round(top_px - focal_length_px * math.tan(lowest_rad)))
    center = (0.5 * (width_px - 1), top_px - 0.5)
    camera = CylindricalCamera(width_px, height_px, focal_length_px, center)
    return View(camera, _turned(yaw_rad) @ BASE_FROM_OPTICAL_LOOKING_AHEAD)


def perspective_view(
    width_px: int,
    height_px: int,
    field_of_view_rad: float,
    yaw_rad: float = 0.0,
    pitch_rad: float = 0.0,
) -> View:
    """Perspective view of a pinhole camera, with its field of view between the left and right edge.

    Yaw is counter-clockwise from the vehicle's front, pitch positive downward as in REP 103.

    Raises:
        OpticsError: a field of view that is not between 0 and 180°, or a size below 1.
    """
    camera = PerspectiveCamera.with_field_of_view(width_px, height_px, field_of_view_rad)
    return View(camera, _turned(yaw_rad, pitch_rad) @ BASE_FROM_OPTICAL_LOOKING_AHEAD)


def birdseye_view(
    size_px: int, half_extent_m: float, height_m: float, yaw_rad: float = 0.0
) -> View:
    """Bird's eye view: a square map of the ground, the vehicle in the middle, its front up.

    `half_extent_m` is from the middle to an edge; the effective viewpoint is `height_m` above the
    ground; the top of the map heads `yaw_rad` counter-clockwise from the vehicle's front.

    Raises:
        OpticsError: an extent, height or size that is not above 0.
    """
    for name, value in (("height", height_m), ("extent", half_extent_m)):
        if not (math.isfinite(value) and value > 0.0):
            raise OpticsError(
                f"bird's eye: {name}: expected a finite number of meters above 0, got {value:g}"
            )
    focal_length_px = 0.5 * size_px * height_m / half_extent_m
    middle = 0.5 * (size_px - 1)
    camera = PerspectiveCamera(size_px, size_px, focal_length_px, (middle, middle))
    return View(camera, _turned(yaw_rad) @ BASE_FROM_OPTICAL_LOOKING_DOWN)


def highest_elevation_deg(camera: CentralCamera, base_from_optical: Floats) -> float:
    """Highest whole degree of elevation, up to 60, visible at all azimuths.

    If there is none, as of a lens that looks ahead, the highest one visible anywhere; else 0.

    `base_from_optical` is the (3, 3) rotation of the camera, level or tilted.
    """
    azimuth = np.radians(np.arange(0.0, 360.0, 5.0))
    highest_deg = 0.0
    for elevation_deg in range(60, -60, -1):
        elevation = math.radians(elevation_deg)
        x, y = math.cos(elevation) * np.cos(azimuth), math.cos(elevation) * np.sin(azimuth)
        base = np.stack((x, y, np.full_like(azimuth, math.sin(elevation))), axis=-1)
        pixels = camera.pixel_from_ray(base @ base_from_optical)
        last = camera.width_px - 1, camera.height_px - 1
        inside = (pixels.positions_px >= 0.0) & (pixels.positions_px <= last)
        seen = pixels.valid & inside.all(axis=-1)
        if seen.all():
            return float(elevation_deg)
        if seen.any():
            highest_deg = max(highest_deg, float(elevation_deg))
    return highest_deg


def _turned(yaw_rad: float, pitch_rad: float = 0.0) -> Floats:
    if not (math.isfinite(yaw_rad) and math.isfinite(pitch_rad)):
        yaw_deg, pitch_deg = math.degrees(yaw_rad), math.degrees(pitch_rad)
        raise OpticsError(
            "view: yaw and pitch: expected finite numbers of degrees, "
            f"got {yaw_deg:g} and {pitch_deg:g}"
        )
    return rotation_from_roll_pitch_yaw(0.0, pitch_rad, yaw_rad)


# Level panorama for landmark detection, and the geometry of its rows and columns.


LOWEST_RAD, HIGHEST_RAD = math.radians(-60.0), math.radians(3.0)
_LEVEL = 1e-9  # maximum error of a rotation about the upright axis


@dataclass(frozen=True, eq=False)
class CameraMount:
    """Camera on a vehicle."""

    camera: CentralCamera
    base_from_optical: Floats  # (4, 4) pose on the vehicle
    # (height, width) pixels that show the scene; None: all valid
    covered: Bools | None = None
    # notice that a single viewpoint is assumed for non-central optics; None: it is not
    caveat: str | None = None

    def assuming_viewpoint(self) -> CameraMount:
        """The same mount; for non-central optics, as if all rays met in one point."""
        if not isinstance(self.camera, NonCentralCamera):
            return self
        from omnisim.cameras.optics.centrality import CentralView  # few cameras need it

        view = CentralView(self.camera)
        base_from_view = view.frame_from_view(self.base_from_optical)
        return CameraMount(view, base_from_view, self.covered, view.caveat())

    @property
    def height_m(self) -> float:
        """Height of the effective viewpoint above the ground."""
        return float(self.base_from_optical[2, 3])

    @property
    def position_m(self) -> tuple[float, float]:
        """Effective viewpoint x, y in the base frame."""
        return float(self.base_from_optical[0, 3]), float(self.base_from_optical[1, 3])


class Panorama:
    """Panorama of a whole turn around a vehicle, from 60° below the horizon to 3° above it.

    Rows and columns count from the center of the first pixel and may have fractions.

    Args:
        mount: camera on the vehicle.
        width_px: columns of the whole turn; None: the length of the horizon in the image, pixels.

    Attributes:
        camera: camera model of the panorama, a cylinder.

    Raises:
        LocalizationError: a camera at or below the ground, or one that sees no part of the horizon.
        OpticsError: the camera sees nothing of the panorama.
    """

    def __init__(self, mount: CameraMount, width_px: int | None = None):
        if not mount.height_m > 0.0:
            raise LocalizationError(
                f"camera: {mount.height_m:g} m above the ground: expected more than 0 for ranges"
            )
        self.mount = mount
        rotation = mount.base_from_optical[:3, :3]
        width = width_px or _horizon_px(mount.camera, rotation)
        view = cylinder_view(width, LOWEST_RAD, HIGHEST_RAD)
        assert isinstance(view.camera, CylindricalCamera)
        self.camera = view.camera
        self._unwarp = Unwarping(
            mount.camera, view.camera, rotation.T @ view.base_from_view, mount.covered
        )

    def __call__(self, image: NDArray[Any]) -> NDArray[Any]:
        """Unwarp an image to a panorama (height, width, 3); black outside the image."""
        return self._unwarp(image)

    @property
    def valid(self) -> Bools:
        """Mask (height, width) of pixels that show the scene."""
        return self._unwarp.valid

    def bearings_rad(self, columns: ArrayLike) -> Floats:
        """Bearings (...) of columns (...), counter-clockwise from the front; unwrapped."""
        u = np.asarray(columns, dtype=np.float64)
        return (self.camera.principal_point_px[0] - u) / self.camera.focal_length_px

    def ranges_m(self, rows: ArrayLike, height_m: float = 0.0) -> Floats:
        """Ranges (...) along the ground at rows (...), for a known height: r = (H − z) tan θ.

        H is the camera's height, z = `height_m` the height of the points, and θ the angle of the
        row from straight down. Infinite at and above the camera's horizon.
        """
        down = self._tangents(rows)
        drop_m = self.mount.height_m - height_m
        return np.where(down > 0.0, drop_m / np.where(down > 0.0, down, 1.0), np.inf)

    def rows(self, ranges_m: ArrayLike, height_m: float = 0.0) -> Floats:
        """Rows (...) of points with known ranges (...) and height."""
        tangents = (self.mount.height_m - height_m) / np.asarray(ranges_m, dtype=np.float64)
        return self.camera.principal_point_px[1] + self.camera.focal_length_px * tangents

    def ranges_eq2_m(self, rows: ArrayLike, height_m: float = 0.0) -> Floats:
        """Ranges (...) of points of known height from the image radius, by the inverse of Eq. 2.

        NaN if Eq. 2 does not apply: the camera has no hyperbolic mirror, or is not upright.
        Infinite at and above the camera's horizon.
        """
        down = self._tangents(rows)
        camera = self.mount.camera
        # straight up, with any rotation about the camera's axis
        rotation = self.mount.base_from_optical[:3, :3] @ RIG_FROM_OPTICAL_LOOKING_UP.T
        is_upright = abs(rotation[2, 2] - 1.0) < _LEVEL
        if not isinstance(camera, HyperbolicCamera) or not is_upright:
            return np.full(down.shape, np.nan)
        theta = 0.5 * math.pi - np.arctan(down)
        radius = camera.image_radius(theta).radii_px
        paper = theta_from_image_radius_eq2_rad(radius, camera.horizon_radius_px)
        near = paper < 0.5 * math.pi
        drop_m = self.mount.height_m - height_m
        return np.where(near, drop_m * np.tan(np.where(near, paper, 0.0)), np.inf)

    def range_sigmas_m(self, ranges_m: ArrayLike, height_m: float, row_sigma_px: float) -> Floats:
        """Standard deviations of ranges, given that of the row: dr/dv = r²/((H − z) f).

        H and z are as in `ranges_m`; f is the panorama's focal length.
        """
        drop_m = self.mount.height_m - height_m
        squared = np.square(np.asarray(ranges_m, dtype=np.float64))
        return squared * row_sigma_px / (abs(drop_m) * self.camera.focal_length_px)

    def heights_m(self, rows: ArrayLike, ranges_m: ArrayLike) -> Floats:
        """Heights (...) above the ground of points at rows (...) with known ranges (...)."""
        return self.mount.height_m - np.asarray(ranges_m) * self._tangents(rows)

    def _tangents(self, rows: ArrayLike) -> Floats:
        """Tangents (...) of the angles of rows (...) below the horizon."""
        v = np.asarray(rows, dtype=np.float64)
        return (v - self.camera.principal_point_px[1]) / self.camera.focal_length_px


def _horizon_px(camera: CentralCamera, base_from_optical: Floats) -> int:
    """Length of the horizon in the image, pixels."""
    step_rad = 1e-3
    headings = np.linspace(-math.pi, math.pi, 72, endpoint=False)

    def pixels(shift_rad: float) -> Any:
        turned = headings + shift_rad
        level = np.stack((np.cos(turned), np.sin(turned), np.full_like(turned, -0.1)), axis=-1)
        level /= np.linalg.norm(level, axis=-1, keepdims=True)
        return camera.pixel_from_ray(level @ base_from_optical)

    start, end = pixels(0.0), pixels(step_rad)
    seen = start.valid & end.valid
    if not seen.any():
        raise LocalizationError("camera: sees nothing of the horizon: no landmark can be found")
    steps = np.linalg.norm(end.positions_px - start.positions_px, axis=-1)[seen]
    return max(64, math.ceil(2.0 * math.pi * float(np.median(steps)) / step_rad))
