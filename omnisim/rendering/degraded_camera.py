"""Degraded camera: plans the sub-frames, exposure and noise of its images."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np

from omnisim.core.array_types import Float64s
from omnisim.core.world import Pose, time_of
from omnisim.rendering.contract import (
    CameraSetup,
    FrameRequest,
    ImageExposure,
    Pending,
    Readback,
    SceneBackend,
    SubFrame,
    SubFrames,
    Taken,
)
from omnisim.rendering.twist import moved_px
from omnisim.scene import Scene
from omnisim.scene.model import Instance
from omnisim.scene.motion.deformation import Deformation

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
            one._replace(world_from_objects=boxes.poses(one.world_from_objects)) for one in ends
        ]
        count = shutter.sub_frame_count(moved_px(sensor.model, moved, boxes.corners_m))
        poses = [motion(float(seconds)) for seconds in shutter.times_s(count)]
        if count == 1:
            return [SubFrame(poses[0], None)]
        row_weights = shutter.row_weights(count, sensor.model.height_px)
        return [SubFrame(*part) for part in zip(poses, row_weights, strict=True)]


# Bounding boxes of moving parts: dynamic objects, and the vertices bound to each joint.
_MIN_VOLUME = 1e-12  # of a joint's transform: flatter ones are ignored


class _JointBox(NamedTuple):
    """Joint of a deforming mesh."""

    object_index: int | None  # index of the dynamic object with the mesh; None: static
    instance: Instance  # instance of the mesh
    deformation: Deformation  # deformation of the mesh
    joint: int  # index of the joint
    bind_from_object: Pose  # (4, 4) transform at 0 s


class MovingBoxes:
    """Bounding boxes in moving frames.

    Attributes:
        corners_m: (8, 3) corners of each box, in its own frame; (0, 3) for an empty box.
    """

    def __init__(self, scene: Scene, objects: Iterable[Scene]):
        objects = list(objects)
        self.corners_m = [_corners_m(one.bounds_m()) for one in objects]
        self._joints: list[_JointBox] = []
        for index, part in enumerate((scene, *objects), start=-1):
            for instance in part.instances:
                deformation = part.meshes[instance.mesh].deformation
                if deformation is not None:
                    self._add(index if index >= 0 else None, instance, deformation)

    def _add(self, object_index: int | None, instance: Instance, deformation: Deformation) -> None:
        matrices = instance.world_from_mesh @ deformation.matrices_at(0.0)
        joints, corners = deformation.joint_boxes()
        for joint, of_joint in zip(joints.tolist(), corners, strict=True):
            matrix = matrices[joint]
            size = float(np.linalg.norm(matrix[:3, :3], 2))
            if abs(np.linalg.det(matrix[:3, :3])) > _MIN_VOLUME * size**3:
                inverse = np.linalg.inv(matrix)
                box = _JointBox(object_index, instance, deformation, joint, inverse)
                self._joints.append(box)
                self.corners_m.append(of_joint @ matrix[:3, :3].T + matrix[:3, 3])

    def poses(self, world_from_objects: Sequence[Pose]) -> list[Pose]:
        """Transforms (4, 4) of the boxes at the objects' poses and time; nearly rigid."""
        poses, time_s = list(world_from_objects), time_of(world_from_objects)
        for index, instance, deformation, joint, bind_from_object in self._joints:
            matrix = deformation.matrices_at(time_s)[joint] @ bind_from_object
            shift = np.eye(4)
            if deformation.targets is not None:
                # maximum displacement of vertices by morph targets
                change = deformation.weights_at(time_s) - deformation.weights_at(0.0)
                shift[0, 3] = np.abs(change) @ deformation.targets.longest
            matrix = instance.world_from_mesh @ shift @ matrix
            poses.append(matrix if index is None else world_from_objects[index] @ matrix)
        return poses


def _corners_m(box_m: Float64s) -> Float64s:
    corners = np.array(list(itertools.product(*box_m.T)))
    return corners if np.isfinite(corners).all() else corners[:0]
