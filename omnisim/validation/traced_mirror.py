"""Scenes with light in a real mirror, traced by Mitsuba beside our pictures."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from omnisim import frames
from omnisim.cameras import HyperbolicCamera, pixel_grid
from omnisim.scene import Scene
from omnisim.sensors import OmniCamera
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
    scene: Scene, sensor: OmniCamera, world_from_base: NDArray[np.float64], samples: int
) -> NDArray[np.float32]:
    """Picture (height, width, 3), linear RGB, of a vehicle's camera, see `trace_lit_mirror`."""
    from omnisim.validation.oracles.mitsuba_light import trace_lit_mirror  # may be missing

    world_from_optical = world_from_base @ sensor.base_from_rig
    world_from_optical[:3, :3] = world_from_optical[:3, :3] @ frames.RIG_FROM_OPTICAL_LOOKING_UP
    return trace_lit_mirror(scene, mirror_camera(sensor), world_from_optical, samples)


def inside_mirror(camera: HyperbolicCamera) -> NDArray[np.bool_]:
    """Mask (height, width) of the pixels that see nothing but the mirror."""
    off_axis = pixel_grid(camera.width_px, camera.height_px) - camera.principal_point_px
    inside: NDArray[np.bool_] = np.linalg.norm(off_axis, axis=-1) < camera.rim_radius_px - 2.0
    return inside
