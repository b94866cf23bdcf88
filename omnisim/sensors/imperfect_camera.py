"""A camera that is not ideal, between a renderer and its passes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from omnisim.errors import OpticsError
from omnisim.gpu.degradation.degradation_pass import DegradationPass
from omnisim.gpu.pipeline import Picture, Pipeline, SubFrame
from omnisim.poses import check_pose
from omnisim.sensors.degradations.effect import MAX_STOPS
from omnisim.sensors.degradations.picture_geometry import PictureGeometry
from omnisim.sensors.degradations.random_numbers import key_of
from omnisim.sensors.motion import Motion, moved_px
from omnisim.sensors.omnicamera import OmniCamera
from omnisim.sensors.stage import Stage


class ImperfectCamera:
    """Plans what the passes of a degradation do for one picture.

    Args:
        sensor: the camera.
        seed: of its noise.
    """

    def __init__(self, sensor: OmniCamera, seed: int | str):
        self.sensor, self.seed = sensor, seed

    def make_pass(self, stage: Stage) -> DegradationPass | None:
        """The passes, or None: the camera is ideal."""
        degradation = self.sensor.degradation
        if degradation.is_ideal:
            return None
        geometry = PictureGeometry.of_camera(self.sensor.model)
        return DegradationPass(
            stage.context,
            (geometry.width_px, geometry.height_px),
            degradation.optics_steps(geometry),
            degradation.sensor_steps(geometry, key_of("noise", self.seed)),
            degradation.encoding_step(),
        )

    def take(
        self,
        pipeline: Pipeline,
        stage: Stage,
        world_from_base: NDArray[np.float64],
        object_poses: Mapping[str, ArrayLike] | None,
        linear: bool,
        motion: Motion | None,
        frame_number: int,
        exposure_ev: float | None,
    ) -> tuple[Picture, dict[str, Any]]:
        """The picture, and what is to be told of it; arguments as `Renderer.render` has them.

        Raises:
            OpticsError: an impossible exposure.
        """
        if exposure_ev is not None and not abs(exposure_ev) <= MAX_STOPS:  # NaN is not, either
            raise OpticsError(
                f"exposure_ev = {exposure_ev:g}: want −{MAX_STOPS:g} to {MAX_STOPS:g} stops"
            )
        sub_frames = self._sub_frames(world_from_base, object_poses, motion, stage)
        degradation = self.sensor.degradation
        told: dict[str, Any] = {"parameters": degradation.tables(), "sub_frames": len(sub_frames)}

        def expose(luminance: float | None) -> dict[str, Any]:
            ev = 0.0 if exposure_ev is None else exposure_ev
            if degradation.exposure is not None:
                metered_ev = degradation.exposure.metered_ev(luminance or 0.0)
                ev = metered_ev if exposure_ev is None else exposure_ev
                told["exposure"] = {"ev": ev, "metered_ev": metered_ev}
            return {
                "u_exposure_factors": degradation.exposure_factors(ev),
                "u_frame": frame_number % 2**32,
            }

        metered = degradation.is_metered
        picture = pipeline.render_degraded(sub_frames, expose, metered, linear)
        if degradation.noise is not None:
            told["noise"] = {"seed": self.seed, "frame_number": frame_number}
        if degradation.jpeg is not None:
            picture = picture._replace(rgba=degradation.jpeg.compressed(picture.rgba))
        return picture, told

    def _sub_frames(
        self,
        world_from_base: NDArray[np.float64],
        object_poses: Mapping[str, ArrayLike] | None,
        motion: Motion | None,
        stage: Stage,
    ) -> list[SubFrame]:
        """Where the camera is while the picture is taken."""
        shutter, rig = self.sensor.degradation.shutter, self.sensor.base_from_rig
        if shutter is None or motion is None or shutter.duration_s == 0.0:
            base = world_from_base
            return [SubFrame(base @ rig, stage.object_poses_at(base, object_poses), None)]
        camera = self.sensor.model
        half_s = 0.5 * shutter.duration_s
        ends = [check_pose(motion(time_s)) for time_s in (-half_s, 0.0, half_s)]
        optical = [base @ self.sensor.base_from_optical for base in ends]
        count = shutter.sub_frame_count(moved_px(camera, optical))
        weights = shutter.row_weights(count, camera.height_px)
        poses = [check_pose(motion(float(time_s))) for time_s in shutter.times_s(count)]
        if count == 1:
            return [SubFrame(poses[0] @ rig, stage.object_poses_at(poses[0], object_poses), None)]
        return [
            SubFrame(base @ rig, stage.object_poses_at(base, object_poses), share)
            for base, share in zip(poses, weights, strict=True)
        ]
