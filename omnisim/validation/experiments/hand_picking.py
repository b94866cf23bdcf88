"""Simulated picking of landmarks by hand: true image positions with Gaussian noise.

The paper's authors picked landmarks in the images of the real robot, since their classifier had too
many false positives. Only here do observations come from the true pose; the filter gets the range
and bearing of the picked pixels and nothing else.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from omnisim.core.poses import wrap_angle
from omnisim.perception.localization.filter import LandmarkMap, Observation
from omnisim.perception.unwarping.panorama import CameraMount


@dataclass(frozen=True)
class Hand:
    """Noise and limits of picking by hand.

    Attributes:
        sigma_px: standard deviation of a picked point, along both image axes.
        farthest_m: maximum distance of a pickable landmark.
        steepest_rad: maximum angle below the horizon; the vehicle hides nearer landmarks.
    """

    sigma_px: float = 1.5
    farthest_m: float = 3.5
    steepest_rad: float = math.radians(58.0)


def pick_landmarks(
    pose: NDArray[np.float64],
    mount: CameraMount,
    landmarks: LandmarkMap,
    hand: Hand,
    generator: np.random.Generator,
) -> list[Observation]:
    """Pick the feet (corners on the ground) of the landmarks that are visible from a true pose.

    A wide landmark's range is that of its nearest foot; its bearing is the middle of its two
    outermost feet.

    Args:
        pose: (3,) x, y, yaw of the base.
        mount: camera on the vehicle.
        landmarks: landmarks at their true positions.
        hand: noise and limits.
        generator: random numbers of the noise.
    """
    observations = []
    for name, corners in landmarks.corners_m.items():
        offsets = _offsets(pose, mount, np.array(corners))
        distances = np.linalg.norm(offsets, axis=1)
        nearest = int(distances.argmin())
        steep_rad = math.atan2(mount.height_m, float(distances[nearest]))
        if distances[nearest] > hand.farthest_m or steep_rad > hand.steepest_rad:
            continue
        about = _relative_directions(offsets)
        outer = sorted({int(about.argmin()), int(about.argmax())})
        picked = _pick(mount, offsets[[nearest, *outer]], hand, generator)
        if picked is None:
            continue
        ranges, bearings = picked
        middle = bearings[1] + 0.5 * wrap_angle(bearings[-1] - bearings[1])
        range_sigma_m, bearing_sigma_rad = _sigmas(mount, float(ranges[0]), hand.sigma_px)
        observations.append(
            Observation(
                (name,),
                float(ranges[0]),
                wrap_angle(middle),
                range_sigma_m,
                bearing_sigma_rad / math.sqrt(len(outer)),
            )
        )
    return observations


def _offsets(
    pose: NDArray[np.float64], mount: CameraMount, corners: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Offsets (n, 2) from below the effective viewpoint to corners, along the vehicle's axes."""
    cosine, sine = math.cos(pose[2]), math.sin(pose[2])
    base_from_world = np.array([[cosine, sine], [-sine, cosine]])
    return (corners - pose[:2]) @ base_from_world.T - mount.position_m


def _relative_directions(offsets: NDArray[np.float64]) -> NDArray[np.float64]:
    """Directions (n,) of offsets relative to the direction of their sum."""
    x, y = offsets.sum(axis=0)
    return np.arctan2(x * offsets[:, 1] - y * offsets[:, 0], offsets @ (x, y))


def _pick(
    mount: CameraMount, offsets: NDArray[np.float64], hand: Hand, generator: np.random.Generator
) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
    """Ranges and bearings of picked points on the ground; None: a point is outside the image."""
    rotation = mount.base_from_optical[:3, :3]
    rays = np.column_stack((offsets, np.full(len(offsets), -mount.height_m)))
    pixels = mount.camera.pixel_from_ray(rays @ rotation)
    noisy = pixels.positions_px + hand.sigma_px * generator.standard_normal((len(offsets), 2))
    picked = mount.camera.ray_from_pixel(noisy)
    level = picked.directions @ rotation.T
    below = level[:, 2] < 0.0
    if not np.all(pixels.valid & picked.valid & below):
        return None
    ranges = mount.height_m * np.hypot(level[:, 0], level[:, 1]) / -level[:, 2]
    return ranges, np.arctan2(level[:, 1], level[:, 0])


def _sigmas(mount: CameraMount, range_m: float, sigma_px: float) -> tuple[float, float]:
    """Standard deviations, in m and rad, of range and bearing of a point picked with `sigma_px`."""
    step = 1e-4
    rotation = mount.base_from_optical[:3, :3]
    theta = math.atan2(range_m, mount.height_m)
    rays = [
        (math.sin(angle) * math.cos(yaw), math.sin(angle) * math.sin(yaw), -math.cos(angle))
        for angle, yaw in ((theta, 0.0), (theta + step, 0.0), (theta, step))
    ]
    picked, outward, sideways = mount.camera.pixel_from_ray(np.array(rays) @ rotation).positions_px
    by_theta = (range_m**2 + mount.height_m**2) / mount.height_m
    return (
        sigma_px * step * by_theta / float(np.linalg.norm(outward - picked)),
        sigma_px * step / float(np.linalg.norm(sideways - picked)),
    )
