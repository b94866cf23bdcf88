"""Scenes with light in a real mirror, traced by Mitsuba beside our pictures."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from omnisim import frames
from omnisim.cameras import HyperbolicCamera, pixel_grid
from omnisim.scene import Scene
from omnisim.sensors import OmniCamera
from omnisim.srgb import srgb_from_linear
from omnisim.validation.fixture import mirror_camera

# Of the paper's mirror, so that its own shadow, which our camera has none of, is a few pixels wide.
_MIRROR_SCALE = 0.25


def small_mirror(size_px: int) -> OmniCamera:
    """Camera of the paper with a smaller mirror, which sees the same."""
    sensor = OmniCamera().with_polygons(None).resized(size_px)
    camera = mirror_camera(sensor)
    scale = _MIRROR_SCALE * camera.mirror.meters_per_unit
    mirror = dataclasses.replace(camera.mirror, meters_per_unit=scale)
    return dataclasses.replace(sensor, model=dataclasses.replace(camera, mirror=mirror))


def traced_in_mirror(
    scene: Scene,
    sensor: OmniCamera,
    world_from_base: NDArray[np.float64],
    samples: int,
    bounces: bool = False,
) -> NDArray[np.float32]:
    """Picture (height, width, 3), linear RGB, of a vehicle's camera, see `trace_lit_mirror`.

    Args:
        scene, samples: see there.
        sensor: with a hyperbolic mirror.
        world_from_base: (4, 4) pose of the vehicle.
        bounces: all light; False: that which comes from a lamp to the surface seen.
    """
    from omnisim.validation.oracles.mitsuba_light import (  # may be missing
        ALL_DEPTH,
        DIRECT_DEPTH,
        trace_lit_mirror,
    )

    world_from_optical = world_from_base @ sensor.base_from_rig
    world_from_optical[:3, :3] = world_from_optical[:3, :3] @ frames.RIG_FROM_OPTICAL_LOOKING_UP
    depth = ALL_DEPTH if bounces else DIRECT_DEPTH
    return trace_lit_mirror(scene, mirror_camera(sensor), world_from_optical, samples, depth=depth)


def inside_mirror(camera: HyperbolicCamera) -> NDArray[np.bool_]:
    """Mask (height, width) of the pixels that see nothing but the mirror."""
    off_axis = pixel_grid(camera.width_px, camera.height_px) - camera.principal_point_px
    inside: NDArray[np.bool_] = np.linalg.norm(off_axis, axis=-1) < camera.rim_radius_px - 2.0
    return inside


def beside(
    name: str, traced: NDArray[np.float32], ours: NDArray[np.float32], inside: NDArray[np.bool_]
) -> dict[str, NDArray[np.generic]]:
    """Pictures of a scene, ours and a traced one, and their enhanced difference, by title."""
    one, other = (np.where(inside[..., None], values, 0.0) for values in (traced, ours))
    off = np.abs(srgb_from_linear(one) - srgb_from_linear(other))
    enhanced = np.rint(255.0 * np.clip(8.0 * off, 0.0, 1.0)).astype(np.uint8)
    return {
        f"{name}, traced by Mitsuba": one,
        f"{name}, by omnisim": other,
        f"{name}, difference × 8": enhanced,
    }
