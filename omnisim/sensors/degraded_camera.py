"""Camera that is not ideal: plans sub-frames, exposure and noise of its pictures."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from omnisim.errors import OpticsError
from omnisim.gpu.degradation.degradation_pass import DegradationPass, UniformValue
from omnisim.gpu.pipeline import DegradedPipeline, Pipeline, Readback, ScenePoses, SubFrame
from omnisim.poses import check_pose
from omnisim.sensors.degradations.effect import MAX_STOPS
from omnisim.sensors.degradations.picture_geometry import PictureGeometry
from omnisim.sensors.degradations.random_numbers import key_of
from omnisim.sensors.motion import Motion, moved_px
from omnisim.sensors.omnicamera import OmniCamera
from omnisim.sensors.stage import Stage


@dataclass(frozen=True, eq=False)
class FrameRequest:
    """Request of one picture; fields as `omnisim.sensors.renderer.Renderer.render` has them."""

    world_from_base: NDArray[np.float64]
    object_poses: Mapping[str, ArrayLike] | None
    linear: bool
    motion: Motion | None
    frame_number: int
    exposure_ev: float | None

    def poses(
        self, stage: Stage, sensor: OmniCamera, world_from_base: NDArray[np.float64]
    ) -> ScenePoses:
        """Poses of a sensor and of all that moves, with the vehicle at a pose (4, 4)."""
        object_poses = stage.object_poses_at(world_from_base, self.object_poses)
        return ScenePoses(world_from_base @ sensor.base_from_rig, object_poses)


class DegradedCamera:
    """Takes the pictures of a camera that is not ideal.

    Args:
        stage: its context is current, here and in `take`.
        sensor: the camera.
        seed: of its noise.
        ideal: pipeline of the sub-frames, float32.
    """

    def __init__(self, stage: Stage, sensor: OmniCamera, seed: int | str, ideal: Pipeline):
        self._stage, self._sensor, self._seed = stage, sensor, seed
        degradation, geometry = sensor.degradation, PictureGeometry.of_camera(sensor.model)
        passes = DegradationPass(
            stage.context,
            (geometry.width_px, geometry.height_px),
            degradation.optics_steps(geometry),
            degradation.sensor_steps(geometry, key_of("noise", seed)),
            degradation.encoding_step(),
        )
        self._pipeline = DegradedPipeline(ideal, passes)

    def take(self, request: FrameRequest) -> tuple[Readback, dict[str, Any]]:
        """Take a picture; also return its metadata.

        Raises:
            OpticsError: an impossible exposure.
        """
        exposure_ev = request.exposure_ev
        if exposure_ev is not None and not abs(exposure_ev) <= MAX_STOPS:  # NaN is not, either
            raise OpticsError(
                f"exposure_ev = {exposure_ev:g}: want −{MAX_STOPS:g} to {MAX_STOPS:g} stops"
            )
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
        stage, sensor, motion = self._stage, self._sensor, request.motion
        shutter = sensor.degradation.shutter
        if shutter is None or motion is None or shutter.duration_s == 0.0:
            return [SubFrame(request.poses(stage, sensor, request.world_from_base), None)]
        half_s = 0.5 * shutter.duration_s
        ends = [check_pose(motion(time_s)) for time_s in (-half_s, 0.0, half_s)]
        optical = [base @ sensor.base_from_optical for base in ends]
        count = shutter.sub_frame_count(moved_px(sensor.model, optical))
        bases = [check_pose(motion(float(time_s))) for time_s in shutter.times_s(count)]
        if count == 1:
            return [SubFrame(request.poses(stage, sensor, bases[0]), None)]
        return [
            SubFrame(request.poses(stage, sensor, base), row_weights)
            for base, row_weights in zip(
                bases, shutter.row_weights(count, sensor.model.height_px), strict=True
            )
        ]
