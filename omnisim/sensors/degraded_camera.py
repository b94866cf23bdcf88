"""Degraded camera: plans the sub-frames, exposure and noise of its pictures."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from omnisim.errors import OpticsError
from omnisim.gpu.degradation.degradation_pass import DegradationPass, UniformValue
from omnisim.gpu.pipeline import DegradedPipeline, Pipeline, Readback, ScenePoses, SubFrame
from omnisim.sensors.degradations.effect import MAX_EV
from omnisim.sensors.degradations.picture_geometry import PictureGeometry
from omnisim.sensors.degradations.random_numbers import key_of
from omnisim.sensors.motion import moved_px
from omnisim.sensors.omnicamera import OmniCamera


@dataclass(frozen=True, eq=False)
class FrameRequest:
    """Request of one picture; see also `omnisim.sensors.renderer.Renderer.render`.

    Attributes:
        poses: in the middle of the frame.
        motion: poses by seconds after the middle of the frame; None: at rest.

    Raises:
        OpticsError: an impossible exposure, also of a camera that has none.
    """

    poses: ScenePoses
    motion: Callable[[float], ScenePoses] | None
    linear: bool
    frame_number: int
    exposure_ev: float | None

    def __post_init__(self) -> None:
        ev = self.exposure_ev
        if ev is not None and not abs(ev) <= MAX_EV:  # NaN is not, either
            raise OpticsError(f"exposure_ev: expected −{MAX_EV:g} to {MAX_EV:g} stops, got {ev:g}")


class DegradedCamera:
    """Takes the pictures of a camera that is not ideal.

    Args:
        sensor: the camera.
        seed: of its noise.
        ideal: pipeline of the sub-frames, float32.
        object_corners_m: (8, 3) corners of the box around each moving object, in its own frame.
    """

    def __init__(
        self,
        sensor: OmniCamera,
        seed: int | str,
        ideal: Pipeline,
        object_corners_m: Sequence[NDArray[np.float64]],
    ):
        self._sensor, self._seed, self._object_corners_m = sensor, seed, object_corners_m
        degradation, geometry = sensor.degradation, PictureGeometry.of_camera(sensor.model)
        passes = DegradationPass(
            ideal.context,
            (geometry.width_px, geometry.height_px),
            degradation.optics_steps(geometry),
            degradation.sensor_steps(geometry, key_of("noise", seed)),
            degradation.encoding_step(),
        )
        self._pipeline = DegradedPipeline(ideal, passes)

    def take(self, request: FrameRequest) -> tuple[Readback, dict[str, Any]]:
        """Take a picture; also return its metadata."""
        exposure_ev = request.exposure_ev
        sub_frames = self._sub_frames(request)
        degradation = self._sensor.degradation
        metadata: dict[str, Any] = {
            "parameters": degradation.tables(),
            "sub_frames": len(sub_frames),
        }

        def expose(luminance: float | None) -> Mapping[str, UniformValue]:
            ev = 0.0 if exposure_ev is None else exposure_ev
            if degradation.exposure is not None:
                metered_ev = degradation.exposure.metered_ev(luminance or 0.0)
                ev = metered_ev if exposure_ev is None else exposure_ev
                metadata["exposure"] = {"ev": ev, "metered_ev": metered_ev}
            return {
                "u_exposure_factors": degradation.exposure_factors(ev),
                "u_frame": request.frame_number % 2**32,
            }

        picture = self._pipeline.render(sub_frames, expose, degradation.is_metered, request.linear)
        if degradation.noise is not None:
            metadata["noise"] = {"seed": self._seed, "frame_number": request.frame_number}
        if degradation.jpeg is not None:
            picture = picture._replace(rgba=degradation.jpeg.compressed(picture.rgba))
        return picture, metadata

    def _sub_frames(self, request: FrameRequest) -> list[SubFrame]:
        """Plan the poses at which the shutter is open."""
        sensor, motion = self._sensor, request.motion
        shutter = sensor.degradation.shutter
        if shutter is None or motion is None or shutter.duration_s == 0.0:
            return [SubFrame(request.poses, None)]
        half_s = 0.5 * shutter.duration_s
        ends = [motion(seconds) for seconds in (-half_s, 0.0, half_s)]
        count = shutter.sub_frame_count(moved_px(sensor.model, ends, self._object_corners_m))
        poses = [motion(float(seconds)) for seconds in shutter.times_s(count)]
        if count == 1:
            return [SubFrame(poses[0], None)]
        row_weights = shutter.row_weights(count, sensor.model.height_px)
        return [SubFrame(*part) for part in zip(poses, row_weights, strict=True)]
