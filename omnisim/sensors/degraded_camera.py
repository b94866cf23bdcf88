"""Degraded camera: plans the sub-frames, exposure and noise of its pictures."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from omnisim.errors import OpticsError
from omnisim.gpu.degradation.degradation_pass import DegradationPass, UniformValue
from omnisim.gpu.pipeline import DegradedPipeline, Pipeline, Readback, ScenePoses, SubFrame
from omnisim.poses import check_pose
from omnisim.sensors.degradations.effect import MAX_EV
from omnisim.sensors.degradations.picture_geometry import PictureGeometry
from omnisim.sensors.degradations.random_numbers import key_of
from omnisim.sensors.motion import PoseFunction, moved_px
from omnisim.sensors.omnicamera import OmniCamera


@dataclass(frozen=True, eq=False)
class FrameRequest:
    """Request of one picture; see also `omnisim.sensors.renderer.Renderer.render`.

    Attributes:
        poses: in the middle of the frame.
        poses_at: from another pose (4, 4) of the vehicle.

    Raises:
        OpticsError: an impossible exposure, also of a camera that has none.
    """

    poses: ScenePoses
    poses_at: Callable[[NDArray[np.float64]], ScenePoses]
    linear: bool
    motion: PoseFunction | None
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
    """

    def __init__(self, sensor: OmniCamera, seed: int | str, ideal: Pipeline):
        self._sensor, self._seed = sensor, seed
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
        ends = [check_pose(motion(time_s)) for time_s in (-half_s, 0.0, half_s)]
        optical = [base @ sensor.base_from_optical for base in ends]
        count = shutter.sub_frame_count(moved_px(sensor.model, optical))
        bases = [check_pose(motion(float(time_s))) for time_s in shutter.times_s(count)]
        if count == 1:
            return [SubFrame(request.poses_at(bases[0]), None)]
        return [
            SubFrame(request.poses_at(base), row_weights)
            for base, row_weights in zip(
                bases, shutter.row_weights(count, sensor.model.height_px), strict=True
            )
        ]
