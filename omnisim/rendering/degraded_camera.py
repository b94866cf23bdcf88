"""Degraded camera: plans the sub-frames, exposure and noise of its images."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from omnisim.core.pending import Pending
from omnisim.rendering.contract import (
    CameraSetup,
    FrameRequest,
    ImageExposure,
    Readback,
    SceneBackend,
    SubFrame,
    SubFrames,
    Taken,
)
from omnisim.rendering.twist import MovingBoxes, moved_px

BeginSubFrames = Callable[[SubFrames], Pending[Readback]]


class DegradedCamera:
    """Takes the images of a non-ideal camera.

    Args:
        world: the back end's scene.
        setup: camera in the scene.
        begin: function that begins to render an image from sub-frames.
    """

    def __init__(self, world: SceneBackend, setup: CameraSetup, begin: BeginSubFrames):
        self._sensor, self._seed, self._begin = setup.sensor, setup.seed, begin
        self._boxes = MovingBoxes(world.scene, world.objects.values())

    def begin(self, request: FrameRequest) -> Pending[Taken]:
        """Begin to take an image, to be returned with its metadata."""
        exposure_ev, degradation = request.exposure_ev, self._sensor.degradation
        exposure = degradation.exposure
        sub_frames = self._sub_frames(request)

        def metered_ev(luminance: float | None) -> float:
            return 0.0 if exposure is None else exposure.metered_ev(luminance or 0.0)

        def expose(luminance: float | None) -> ImageExposure:
            ev = metered_ev(luminance) if exposure_ev is None else exposure_ev
            return ImageExposure(degradation.exposure_factors(ev), request.frame_number % 2**32)

        begun = self._begin(
            SubFrames(
                sub_frames,
                expose,
                degradation.meter,
                request.linear,
                request.frame_number,
                is_exposed=exposure_ev is not None,
            )
        )

        def finished(image: Readback) -> Taken:
            metadata: dict[str, Any] = {
                "parameters": degradation.tables(),
                "sub_frames": len(sub_frames),
            }
            if exposure is not None:
                metered = metered_ev(image.luminance)
                ev = metered if exposure_ev is None else exposure_ev
                metadata["exposure"] = {"ev": ev, "metered_ev": metered}
            if degradation.noise is not None:
                metadata["noise"] = {"seed": self._seed, "frame_number": request.frame_number}
            if degradation.jpeg is not None:
                image = image._replace(rgba=degradation.jpeg.compressed(image.rgba))
            return image, metadata

        return begun.then(finished)

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
            end._replace(world_from_objects=boxes.poses(end.world_from_objects)) for end in ends
        ]
        count = shutter.sub_frame_count(moved_px(sensor.model, moved, boxes.corners_m))
        poses = [motion(float(seconds)) for seconds in shutter.times_s(count)]
        if count == 1:
            return [SubFrame(poses[0], None)]
        row_weights = shutter.row_weights(count, sensor.model.height_px)
        return [SubFrame(*part) for part in zip(poses, row_weights, strict=True)]
