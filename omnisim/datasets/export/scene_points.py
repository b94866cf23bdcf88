"""Points of the scene from the ranges of a run's images, with the images that see each point.

Every k-th row and column of every image gives points. An image sees a point if the range of the
pixel nearest to the point's projection equals the point's distance to 1 %. On surfaces that are not
seen at grazing angles, the two differ by less; where an occluder hides the point, by more.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from omnisim.core.poses import inverse
from omnisim.datasets.export.lens_camera import LensCamera
from omnisim.datasets.export.recording import Recording

MAX_POINTS = 20_000
AGREEMENT = 0.01  # share of the range


class Observations(NamedTuple):
    """Points visible in an image.

    Attributes:
        points: (n,) indices of the points, ascending.
        pixels: (n, 2) projections into the exported image, px from the center of the first pixel.
    """

    points: NDArray[np.intp]
    pixels: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class ScenePoints:
    """Points of the scene.

    Attributes:
        positions_m: (n, 3) in the world.
        colors: (n, 3) sRGB.
    """

    positions_m: NDArray[np.float64]
    colors: NDArray[np.uint8]

    def __len__(self) -> int:
        return len(self.positions_m)


def sample_points(
    recording: Recording, cameras: list[LensCamera], max_points: int = MAX_POINTS
) -> ScenePoints:
    """Points seen by evenly spaced pixels of all images; empty if no image has ranges.

    Args:
        recording: run to export.
        cameras: cameras that see the points.
        max_points: approximate maximum number of points.

    Raises:
        OmnisimError: a file is missing or damaged.
    """
    ranged = [camera for camera in cameras if camera.recorded.has("range")]
    pixels = recording.steps * sum(math.prod(camera.recorded.size_px) for camera in ranged)
    step_px = max(1, math.ceil(math.sqrt(pixels / max_points)))
    positions: list[NDArray[Any]] = [np.zeros((0, 3))]
    colors: list[NDArray[Any]] = [np.zeros((0, 3), dtype=np.uint8)]
    for step in range(recording.steps):
        for camera in ranged:
            ranges_m = camera.recorded.channel(step, "range")
            chosen = np.full(ranges_m.shape, np.inf, dtype=ranges_m.dtype)
            chosen[step_px // 2 :: step_px, step_px // 2 :: step_px] = ranges_m[
                step_px // 2 :: step_px, step_px // 2 :: step_px
            ]
            points_m, hit = camera.recorded.points_m(chosen)
            base_from_optical = camera.recorded.mount.base_from_optical
            pose = recording.truth.world_from_base[step] @ base_from_optical
            positions.append(points_m @ pose[:3, :3].T + pose[:3, 3])
            colors.append(camera.recorded.image(step)[hit])
    return ScenePoints(np.concatenate(positions), np.concatenate(colors))


def observations(
    recording: Recording, cameras: list[LensCamera], points: ScenePoints, front_only: bool
) -> Iterator[Observations]:
    """Points visible in each image, step by step and camera by camera.

    Args:
        recording: run to export.
        cameras: cameras of the images.
        points: points of the scene.
        front_only: True: leave out points at and past 90° from a lens's axis, except in panoramas.

    Raises:
        OmnisimError: a file is missing or damaged.
    """
    for step in range(recording.steps):
        for camera in cameras:
            yield _observations(recording, camera, step, points, front_only)


def _observations(
    recording: Recording, camera: LensCamera, step: int, points: ScenePoints, front_only: bool
) -> Observations:
    if not camera.recorded.has("range"):
        return Observations(np.zeros(0, dtype=np.intp), np.zeros((0, 2)))
    pose = recording.truth.world_from_base[step] @ camera.recorded.mount.base_from_optical
    optical_from_world = inverse(pose)
    local_m = points.positions_m @ optical_from_world[:3, :3].T + optical_from_world[:3, 3]
    distances_m = np.linalg.norm(local_m, axis=-1)
    projected = camera.model.pixel_from_ray(local_m)
    width, height = camera.recorded.size_px
    nearest = np.rint(np.where(projected.valid[:, None], projected.positions_px, -1.0))
    inside = projected.valid & np.all((nearest >= 0) & (nearest < (width, height)), axis=-1)
    if front_only and not camera.is_panorama:
        inside &= local_m @ camera.axis > 0.0
    seen = np.flatnonzero(inside)
    u, v = nearest[seen].astype(np.intp).T
    ranges_m = camera.recorded.channel(step, "range")[v, u]
    with np.errstate(invalid="ignore"):  # of missing hits
        agrees = np.abs(ranges_m - distances_m[seen]) <= AGREEMENT * distances_m[seen]
    seen = seen[agrees]
    pixels = projected.positions_px[seen]
    if camera.is_flipped:
        pixels = np.stack((width - 1 - pixels[:, 0], pixels[:, 1]), axis=-1)
    return Observations(seen, pixels)
