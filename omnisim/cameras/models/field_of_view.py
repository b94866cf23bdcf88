"""Field of view of an image: angles, share of valid pixels, and edge of the valid domain.

All values are computed from the camera's rays alone, so they apply to every model.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from omnisim.cameras.camera import CentralCamera
from omnisim.cameras.parametric_camera import ParametricCamera
from omnisim.core.arrays import Bools, Floats

SAMPLES = 129  # per line from the image center
HALVINGS = 60  # from the distance between samples to the last bit of a pixel
GRID = 65  # samples per side, for the share of the image that a lens leaves black
MIN_UNSEEN = 0.01  # smallest share worth a note
THETA_TOLERANCE_RAD = 1e-3
MAX_PIXELS = 1 << 19  # evaluated at once; gives a share to a few hundredths of a percent


@dataclass(frozen=True)
class FieldOfView:
    """Field of view of an image.

    An angle of view is swept by a ray through the axis, from one edge of the valid pixels to the
    other; it may exceed 180°.
    """

    covered: float  # share of valid pixels
    # (3,) zero direction of the angles: +z of the optical frame, −z for a mirror
    axis: tuple[float, float, float]
    theta_max_rad: float  # largest angle from the axis in the image
    # largest angle from the axis if the image had no edges: limited by θ_max, a fold or the model
    # itself; π without a limit
    theta_limit_rad: float
    # horizontal_rad, vertical_rad: angles of view along the row and the column of the axis
    horizontal_rad: float
    vertical_rad: float
    diagonal_rad: float  # larger of the two angles of view from corner to corner


def field_of_view(camera: CentralCamera) -> FieldOfView:
    """Field of view of a camera's image."""
    axis = optical_axis(camera)
    left, right, up, down, *corners = sweeps(camera)
    widest_rad, limit_rad = largest_theta_rad(camera), _model_limit_rad(camera, axis)
    diagonal = max(corners[0] + corners[3], corners[1] + corners[2])
    angles = widest_rad, limit_rad, left + right, up + down, diagonal
    return FieldOfView(covered_share(camera), (0.0, 0.0, axis), *angles)


def angles_of_view(camera: CentralCamera) -> tuple[float, float]:
    """Angles of view along the row and along the column of the axis, in radians."""
    left, right, up, down, *_ = sweeps(camera)
    return left + right, up + down


def field_notes(camera: CentralCamera) -> tuple[str, ...]:
    """Notes on a lens that ends inside its image, or before its stated θ_max."""
    stated_rad = camera.domain_limit_rad
    shares = (np.arange(GRID) + 0.5) / GRID
    u, v = (side * shares - 0.5 for side in (camera.width_px, camera.height_px))
    unseen = 1.0 - float(_sees(camera, np.stack(np.meshgrid(u, v), axis=-1)).mean())
    if stated_rad is None and unseen < MIN_UNSEEN:
        return ()
    limit_rad = _model_limit_rad(camera, optical_axis(camera))
    if limit_rad > math.pi - THETA_TOLERANCE_RAD:  # the whole sphere
        return ()
    end = f"{'folds' if is_fold(camera, limit_rad) else 'ends'} at {_degrees(limit_rad)}"
    if stated_rad is not None:
        if stated_rad < limit_rad + THETA_TOLERANCE_RAD:
            return ()
        return (f"θ_max = {_degrees(stated_rad)} is never reached: the lens {end}",)
    return (f"the lens {end}, inside the image: {100.0 * unseen:.0f} % of the image is black",)


def is_fold(camera: CentralCamera, limit_rad: float) -> bool:
    """True if a camera's lens folds at the angle at which the camera ends."""
    fold_rad: float = getattr(getattr(camera, "lens", camera), "fold_rad", math.inf)
    return abs(limit_rad - fold_rad) < 1e-6


def _degrees(angle_rad: float) -> str:
    return f"{math.degrees(angle_rad):.1f}°"


def optical_axis(camera: CentralCamera) -> float:
    """Sign of z, in the optical frame, of the ray at the principal point: −1 for mirrors."""
    return -1.0 if camera.ray_from_pixel(camera.principal_point_px).directions[2] < 0.0 else 1.0


def covered_share(camera: CentralCamera) -> float:
    """Share of valid pixels in an image; a large image is subsampled."""
    skip = math.ceil(math.sqrt(camera.width_px * camera.height_px / MAX_PIXELS))
    columns = np.arange(0, camera.width_px, skip, dtype=np.float64)
    rows = np.arange(0, camera.height_px, skip, dtype=np.float64)
    pixels = np.stack(np.meshgrid(columns, rows), axis=-1)
    return float(_sees(camera, pixels).mean())


def _sees(camera: CentralCamera, pixels: Floats) -> Bools:
    """Mask (...,) of the valid pixels (..., 2)."""
    if isinstance(camera, ParametricCamera):
        return camera.sees(pixels)
    return camera.ray_from_pixel(pixels).valid


def largest_theta_rad(camera: CentralCamera) -> float:
    """Largest angle from the axis in the image; 0 without a valid pixel."""
    pixels = np.concatenate((edge_pixels(camera, 720), corner_pixels(camera)))
    rays = camera.ray_from_pixel(pixels)
    return float(angles_from_axis(rays.directions[rays.valid], optical_axis(camera)).max(initial=0))


def angles_from_axis(directions: Floats, axis: float) -> Floats:
    """Angles (...,) of directions (..., 3) from +z for an `axis` of 1, from −z for −1."""
    return np.arctan2(np.hypot(directions[..., 0], directions[..., 1]), axis * directions[..., 2])


def edge_pixels(camera: CentralCamera, count: int, phase: float = 0.0) -> Floats:
    """Positions (n, 2) on the edge of the valid pixels, on `count` lines from the center.

    Positions are exact to the last bit where the domain ends in the image. Elsewhere they lie on
    the image border, half a pixel outside the outermost pixel centers. Lines are evenly spaced in
    angle, and rotated by a share (`phase`) of it; those without a valid pixel give no position.
    """
    angles = (np.arange(count) + phase) * (2.0 * math.pi / count)
    outwards = np.stack((np.cos(angles), np.sin(angles)), axis=-1)
    start = _start(camera)
    # the nearest border in each line's direction
    with np.errstate(divide="ignore", invalid="ignore"):  # 0/0: a line along a border it starts on
        to_border = np.where(outwards > 0.0, _last(camera) - start, -0.5 - start) / outwards
    length = np.where(outwards == 0.0, np.inf, to_border).min(axis=-1)
    return _last_seen(camera, start, start + outwards * length[:, None])[0]


def _last_seen(camera: CentralCamera, start: Floats, ends: Floats) -> tuple[Floats, Bools]:
    """Last valid positions (m, 2) on lines from `start` (2,) to `ends` (n, 2).

    Also returns the mask (n,) of the lines with a valid position.
    """
    share = np.linspace(0.0, 1.0, SAMPLES)[:, None, None]
    valid = _sees(camera, start + share * (ends - start))
    meets: Bools = np.any(valid, axis=0)
    ends, valid = ends[meets], valid[:, meets]
    last = SAMPLES - 1 - np.argmax(valid[::-1], axis=0)
    shares = last / (SAMPLES - 1.0)
    (before_end,) = np.nonzero(last < SAMPLES - 1)
    if len(before_end):
        seen, ways = shares[before_end], (ends - start)[before_end]
        unseen = seen + 1.0 / (SAMPLES - 1.0)
        for _ in range(HALVINGS):
            middle = 0.5 * (seen + unseen)
            inside = _sees(camera, start + middle[:, None] * ways)
            seen, unseen = np.where(inside, middle, seen), np.where(inside, unseen, middle)
        shares[before_end] = seen
    return start + shares[:, None] * (ends - start), meets


def _start(camera: CentralCamera) -> Floats:
    """Principal point (2,), or the nearest point in the image."""
    return np.clip(np.asarray(camera.principal_point_px, dtype=np.float64), -0.5, _last(camera))


def _last(camera: CentralCamera) -> Floats:
    return np.array([camera.width_px - 0.5, camera.height_px - 0.5])


def corner_pixels(camera: CentralCamera) -> Floats:
    """Corners (4, 2) of the image, half a pixel outside its corner pixels."""
    u, v = _last(camera)
    return np.array([[-0.5, -0.5], [u, -0.5], [-0.5, v], [u, v]])


def sweeps(camera: CentralCamera) -> list[float]:
    """Angles swept by a ray from the axis to the left, right, up, down, and to the corners."""
    start = _start(camera)
    (u, v), (last_u, last_v) = start, _last(camera)
    ends = np.array([[-0.5, v], [last_u, v], [u, -0.5], [u, last_v], *corner_pixels(camera)])
    seen, meets = _last_seen(camera, start, ends)
    lines = start + np.linspace(0.0, 1.0, SAMPLES)[:, None, None] * (seen - start)
    rays = camera.ray_from_pixel(lines)
    chords = np.linalg.norm(np.diff(rays.directions, axis=0), axis=-1).T
    both = (rays.valid[1:] & rays.valid[:-1]).T
    angles = 2.0 * np.arcsin(np.minimum(0.5 * chords, 1.0))
    swept = np.zeros(len(ends))
    swept[meets] = [angle[known].sum() for angle, known in zip(angles, both, strict=True)]
    return swept.tolist()


def _model_limit_rad(camera: CentralCamera, axis: float) -> float:
    """Largest angle from the axis at which the model sees some direction."""
    azimuth = np.linspace(0.0, 2.0 * math.pi, 16, endpoint=False)

    def last_seen(thetas: Floats) -> int:
        """Index of the largest angle that is seen; −1: none is."""
        across = np.sin(thetas)[:, None]
        along = np.broadcast_to(axis * np.cos(thetas)[:, None], (len(thetas), len(azimuth)))
        rays = np.stack((across * np.cos(azimuth), across * np.sin(azimuth), along), axis=-1)
        seen = np.flatnonzero(camera.pixel_from_ray(rays).valid.any(axis=1))
        return int(seen[-1]) if len(seen) else -1

    thetas = np.linspace(0.0, math.pi, SAMPLES)
    last = last_seen(thetas)
    if last in (-1, SAMPLES - 1):
        return math.pi if last > 0 else 0.0
    low, high = thetas[last : last + 2].tolist()
    for _ in range(HALVINGS // 6):  # six halvings at once: each call takes about as long
        parts = np.linspace(low, high, 65)
        last = last_seen(parts[1:-1]) + 1
        low, high = parts[last : last + 2].tolist()
    return low
