"""Images of lit scenes, in a physical mirror and through a fisheye, traced by Mitsuba."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from omnisim.cameras import EquidistantCamera, HyperbolicCamera, pixel_grid
from omnisim.core import coordinate_frames as frames
from omnisim.core.arrays import Bools, Floats, Floats32
from omnisim.core.errors import OpticsError
from omnisim.core.srgb import srgb_from_linear
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.shared_scene import BackendName
from omnisim.report.report import Measure
from omnisim.scene import Scene
from omnisim.validation.fixture import Fixture, linear_image, mirror_camera

CAMERAS = ("mirror", "fisheye")
# Of the paper's mirror, so that its own shadow, which our camera lacks, is a few pixels wide.
_MIRROR_SCALE = 0.25
_FISHEYE_THETA_RAD = math.radians(95.0)
_RIM_PX = 2.0  # excluded, as pixels blend there


class TracedView(NamedTuple):
    """Image of a scene from its start, by one of the `CAMERAS`."""

    camera: str
    scene: Scene
    sensor: OmniCamera
    pose: Floats  # (4, 4) world_from_base
    inside: Bools  # (height, width) pixels well inside the rim

    def ours(
        self, fixture: Fixture, scene: Scene | None = None, backend: BackendName = "cube"
    ) -> Floats32:
        """Linear image (height, width, 3) by omnisim, of the scene or of a version of it."""
        scene = self.scene if scene is None else scene
        frame = fixture.render(scene, self.sensor, self.pose, unlit=False, backend=backend)
        return linear_image(frame)

    def traced(self, samples: int, bounces: bool = False) -> Floats32:
        """Linear image (height, width, 3) by Mitsuba, see `traced_light`."""
        return traced_light(self.scene, self.sensor, self.pose, samples, bounces)

    def traced_twice(self, samples: int) -> tuple[Floats32, Floats32]:
        """Two images of all light with independent noise."""
        first, second = (
            traced_light(self.scene, self.sensor, self.pose, samples, bounces=True, seed=seed)
            for seed in (0, 1000)
        )
        return first, second


def views(scene: Scene, size_px: int, cameras: Sequence[str] = CAMERAS) -> Iterator[TracedView]:
    """Views of a scene from its start, by cameras named in `CAMERAS`."""
    for camera in cameras:
        sensor = small_mirror(size_px) if camera == "mirror" else fisheye(size_px)
        pose = sensor.base_pose(scene.start.position_m, yaw_deg=20.0)
        yield TracedView(camera, scene, sensor, pose, inside_rim(sensor))


def ray_counts(samples: Mapping[str, int]) -> list[Measure]:
    """Rays per pixel of each camera; `samples` of the fisheye are per texel, 1/16 of a pixel."""
    measures = [Measure("rays per pixel of the mirror", samples["mirror"])]
    return [*measures, Measure("rays per pixel of the fisheye", 16 * samples["fisheye"])]


def small_mirror(size_px: int) -> OmniCamera:
    """The paper's camera with a smaller mirror and the same view."""
    sensor = OmniCamera().with_polygons(None).resized(size_px)
    camera = mirror_camera(sensor)
    scale = _MIRROR_SCALE * camera.mirror.meters_per_unit
    mirror = dataclasses.replace(camera.mirror, meters_per_unit=scale)
    return dataclasses.replace(sensor, model=dataclasses.replace(camera, mirror=mirror))


def fisheye(size_px: int) -> OmniCamera:
    """Camera with an equidistant fisheye of 190°, which looks ahead."""
    middle = 0.5 * (size_px - 1)
    focal_px = 0.5 * size_px / _FISHEYE_THETA_RAD
    lens = EquidistantCamera(size_px, size_px, focal_px, (middle, middle), _FISHEYE_THETA_RAD)
    return OmniCamera(model=lens, polygons=None)


def traced_light(
    scene: Scene,
    sensor: OmniCamera,
    world_from_base: Floats,
    samples: int,
    bounces: bool = False,
    seed: int = 0,
) -> Floats32:
    """Image (height, width, 3), linear RGB, of a vehicle's camera, by Mitsuba.

    Args:
        scene: see `lit_world`.
        sensor: sensor with a hyperbolic mirror or an equidistant fisheye.
        world_from_base: (4, 4) pose of the vehicle.
        samples: see `trace_lit_mirror` and `trace_lit_fisheye`.
        bounces: True: all light; False: only light from a lamp directly to the visible surface.
        seed: equal seeds give equal images.

    Raises:
        OpticsError: the camera has another model.
    """
    from omnisim.validation.oracles.mitsuba_light import (
        ALL_DEPTH,
        DIRECT_DEPTH,
        trace_lit_fisheye,  # of an extra
        trace_lit_mirror,
    )

    depth = ALL_DEPTH if bounces else DIRECT_DEPTH
    pose = world_from_base @ sensor.base_from_rig
    model = sensor.model
    if isinstance(model, HyperbolicCamera):
        pose[:3, :3] = pose[:3, :3] @ frames.RIG_FROM_OPTICAL_LOOKING_UP
        return trace_lit_mirror(scene, model, pose, samples, seed, depth)
    if isinstance(model, EquidistantCamera):
        pose[:3, :3] = pose[:3, :3] @ frames.BASE_FROM_OPTICAL_LOOKING_AHEAD
        return trace_lit_fisheye(scene, model, pose, samples, seed, depth)
    raise OpticsError(f"expected a mirror or a fisheye, got model {model.model_name!r}")


def inside_rim(sensor: OmniCamera) -> Bools:
    """Mask (height, width) of the pixels well inside the mirror's rim or the fisheye's circle.

    Raises:
        OpticsError: the camera has neither a hyperbolic mirror nor an equidistant fisheye.
    """
    camera = sensor.model
    if isinstance(camera, HyperbolicCamera):
        radius_px = camera.rim_radius_px
    elif isinstance(camera, EquidistantCamera):
        radius_px = camera.focal_length_px * camera.theta_max_rad
    else:
        raise OpticsError(f"expected a mirror or a fisheye, got model {camera.model_name!r}")
    off_axis = pixel_grid(camera.width_px, camera.height_px) - camera.principal_point_px
    return np.linalg.norm(off_axis, axis=-1) < radius_px - _RIM_PX


def beside(
    name: str, traced: Floats32, ours: Floats32, inside: Bools
) -> dict[str, NDArray[np.generic]]:
    """Traced image, omnisim's image, and their difference × 8, by title; black outside the mask."""
    first, second = (np.where(inside[..., None], values, 0.0) for values in (traced, ours))
    off = np.abs(srgb_from_linear(first) - srgb_from_linear(second))
    enhanced = np.rint(255.0 * np.clip(8.0 * off, 0.0, 1.0)).astype(np.uint8)
    start = f"{name}, " if name else ""
    return {
        f"{start}traced by Mitsuba": first,
        f"{start}by omnisim": second,
        f"{start}difference × 8": enhanced,
    }
