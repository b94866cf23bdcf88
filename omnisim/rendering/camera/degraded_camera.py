"""Degraded camera: plans the sub-frames, exposure and noise of its images."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.readback import FrameRequest, ImageExposure, Readback, SubFrame, SubFrames
from omnisim.rendering.truth.moving_boxes import MovingBoxes
from omnisim.rendering.twist import moved_px


class DegradedCamera:
    """Takes the images of a non-ideal camera.

    Args:
        sensor: camera sensor.
        seed: seed of its noise.
        render: function that renders an image from sub-frames.
        boxes: bounding boxes of the moving parts.
    """

    def __init__(
        self,
        sensor: OmniCamera,
        seed: int | str,
        render: Callable[[SubFrames], Readback],
        boxes: MovingBoxes,
    ):
        self._sensor, self._seed, self._render, self._boxes = sensor, seed, render, boxes

    def take(self, request: FrameRequest) -> tuple[Readback, dict[str, Any]]:
        """Take an image; also return its metadata."""
        exposure_ev = request.exposure_ev
        sub_frames = self._sub_frames(request)
        degradation = self._sensor.degradation
        metadata: dict[str, Any] = {
            "parameters": degradation.tables(),
            "sub_frames": len(sub_frames),
        }

        def expose(luminance: float | None) -> ImageExposure:
            ev = 0.0 if exposure_ev is None else exposure_ev
            if degradation.exposure is not None:
                metered_ev = degradation.exposure.metered_ev(luminance or 0.0)
                ev = metered_ev if exposure_ev is None else exposure_ev
                metadata["exposure"] = {"ev": ev, "metered_ev": metered_ev}
            return ImageExposure(degradation.exposure_factors(ev), request.frame_number % 2**32)

        image = self._render(
            SubFrames(sub_frames, expose, degradation.meter, request.linear, request.frame_number)
        )
        if degradation.noise is not None:
            metadata["noise"] = {"seed": self._seed, "frame_number": request.frame_number}
        if degradation.jpeg is not None:
            image = image._replace(rgba=degradation.jpeg.compressed(image.rgba))
        return image, metadata

    def _sub_frames(self, request: FrameRequest) -> list[SubFrame]:
        """Plan the poses at which the shutter is open."""
        sensor, motion = self._sensor, request.motion
        shutter = sensor.degradation.shutter
        if shutter is None or motion is None or shutter.duration_s == 0.0:
            return [SubFrame(request.poses, None)]
        half_s = 0.5 * shutter.duration_s
        ends = [motion(seconds) for seconds in (-half_s, 0.0, half_s)]
        boxes = self._boxes
        moved = [
            one._replace(world_from_objects=boxes.poses(one.world_from_objects)) for one in ends
        ]
        count = shutter.sub_frame_count(moved_px(sensor.model, moved, boxes.corners_m))
        poses = [motion(float(seconds)) for seconds in shutter.times_s(count)]
        if count == 1:
            return [SubFrame(poses[0], None)]
        row_weights = shutter.row_weights(count, sensor.model.height_px)
        return [SubFrame(*part) for part in zip(poses, row_weights, strict=True)]
