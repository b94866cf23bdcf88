"""Markers: small discs around the viewpoint, and their centroids in images."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from omnisim.cameras import CentralCamera
from omnisim.scene import Scene
from omnisim.validation.plain_scenes import WHITE, discs, plain_scene

# About 12 pixels wide in an image of 1024: sampling errors at the edge average out.
MARKER_RADIUS_RAD = math.radians(0.8)
WINDOW_PX = 12


def marker_positions(
    viewpoint_m: ArrayLike, axis: ArrayLike, max_rad: float, count: int
) -> NDArray[np.float64]:
    """Points (count, 3) in directions up to `max_rad` from an axis (3,), 0.6 to 12 m away.

    Source: a spiral by the golden angle, so that no two directions are close together.
    """
    index = np.arange(count) + 0.5
    cosines = 1.0 - index / count * (1.0 - math.cos(max_rad))
    azimuths = index * math.pi * (3.0 - math.sqrt(5.0))
    sines = np.sqrt(1.0 - cosines**2)
    local = np.stack((sines * np.cos(azimuths), sines * np.sin(azimuths), cosines), axis=1)
    z = np.asarray(axis, dtype=np.float64)
    x = np.cross(z, [0.3, 0.9, 0.1])
    x /= np.linalg.norm(x)
    directions = local @ np.stack((x, np.cross(z, x), z))
    ranges = 0.6 * 20.0 ** np.random.default_rng(7).random(count)
    return np.asarray(viewpoint_m) + directions * ranges[:, None]


def marker_scene(positions_m: NDArray[np.float64], viewpoint_m: ArrayLike) -> Scene:
    """Scene of white discs on black, at points (n, 3) of the world frame, facing the viewpoint."""
    mesh = discs("markers", positions_m, viewpoint_m, MARKER_RADIUS_RAD, corners=96)
    return plain_scene("markers", (mesh, WHITE))


def marker_rims(positions_m: NDArray[np.float64], viewpoint_m: ArrayLike) -> NDArray[np.float64]:
    """Points (n, 96, 3), world, around the rim of each marker."""
    corners = 96
    mesh = discs("rims", positions_m, viewpoint_m, MARKER_RADIUS_RAD, corners=corners)
    rims = mesh.positions[len(positions_m) :].astype(np.float64)
    return rims.reshape(corners, len(positions_m), 3).swapaxes(0, 1)


def rim_centroids_px(rims_px: NDArray[np.float64]) -> NDArray[np.float64]:
    """Centroids (n, 2) of the areas inside closed polygons (n, corners, 2) in the image.

    The centroid of a disc's image is not the image of the disc's center: for markers, the two
    differ by 0.03 px.
    """
    start = rims_px.mean(axis=1, keepdims=True)
    local = rims_px - start
    following = np.roll(local, -1, axis=1)
    areas = local[..., 0] * following[..., 1] - local[..., 1] * following[..., 0]
    moments = ((local + following) * areas[..., None]).sum(axis=1)
    return start[:, 0] + moments / (3.0 * areas.sum(axis=1))[:, None]


def inside_valid_area(
    camera: CentralCamera, positions_px: NDArray[np.float64], margin_px: float = WINDOW_PX + 2.0
) -> NDArray[np.bool_]:
    """Mask (n,) of positions (n, 2) surrounded by valid pixels only."""
    angles = 2.0 * np.pi * np.arange(16) / 16
    around = positions_px[:, None] + margin_px * np.stack((np.cos(angles), np.sin(angles)), axis=1)
    inside = (around >= 0.0) & (around <= (camera.width_px - 1, camera.height_px - 1))
    clear = camera.ray_from_pixel(around).valid & inside.all(axis=2)
    return np.all(clear, axis=1)


def centroids(brightness: NDArray[np.float64], near_px: NDArray[np.float64]) -> NDArray[np.float64]:
    """Centroids (n, 2) of brightness in windows around positions (n, 2); NaN for a dark window.

    Args:
        brightness: image (height, width).
        near_px: centers of the windows.
    """
    positions_px = np.full(near_px.shape, np.nan)
    for index, (u, v) in enumerate(np.rint(near_px).astype(int)):
        rows = slice(v - WINDOW_PX, v + WINDOW_PX + 1)
        columns = slice(u - WINDOW_PX, u + WINDOW_PX + 1)
        window = brightness[rows, columns]
        total = float(window.sum())
        if total > 1.0:  # in pixels: a marker has dozens
            down, right = np.mgrid[rows, columns]
            positions_px[index] = (window * right).sum() / total, (window * down).sum() / total
    return positions_px
