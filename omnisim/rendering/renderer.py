"""Renderer of a camera in a scene: poses in, frames out."""

from __future__ import annotations

import dataclasses
from collections.abc import Collection
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from omnisim.core.errors import GraphicsError, OmnisimError, RunError
from omnisim.core.files.image_files import read_image
from omnisim.core.files.written_files import is_written
from omnisim.core.poses import check_pose, inverse
from omnisim.core.srgb import srgb8_from_linear
from omnisim.core.world import Motion, ObjectPart, WorldState, time_of
from omnisim.ground_truth import Labels, check_channels
from omnisim.ground_truth.channel_files import write_sidecars
from omnisim.ground_truth.channels import ChannelName
from omnisim.ground_truth.frame import Frame
from omnisim.ground_truth.npy import ChannelFormat
from omnisim.rendering.backend import CameraBackend, CameraSetup
from omnisim.rendering.batches import BatchRenderer, needed_others
from omnisim.rendering.camera.omnicamera import (
    BOXES_3D_SUFFIX,
    BOXES_SUFFIX,
    CHANNELS_SUFFIX,
    IMAGE_SUFFIX,
    OmniCamera,
)
from omnisim.rendering.near_plane import scene_size_m
from omnisim.rendering.readback import FrameRequest, Pending, ScenePoses
from omnisim.rendering.sensor import Moment, Mount
from omnisim.rendering.shared_scene import SharedScene

if TYPE_CHECKING:  # slow to import, and seldom needed
    from omnisim.ground_truth.boxes_3d import OrientedBox

PendingFrame = Pending[Frame]


@dataclass(frozen=True, eq=False)
class RecordedFrame:
    """Image of a camera in a run, with channels of ground truth.

    Attributes:
        frame: rendered image with its channels.
        number: index of the measurement.
        channel_format: file format of the ground truth.
    """

    frame: Frame
    number: int
    channel_format: ChannelFormat

    @property
    def metadata(self) -> dict[str, Any]:
        """Camera, mirror, scene, pose and degradation, as JSON-compatible values."""
        return self.frame.metadata

    def save(self, stem: Path) -> None:
        """Write the missing files: channels, boxes, and finally the image.

        Raises:
            OutputError: a file cannot be written.
        """
        from omnisim.ground_truth.boxes_3d import boxes_json
        from omnisim.ground_truth.coco import coco_image, write_json
        from omnisim.ground_truth.exr import write_exr

        frame, files = self.frame, self.channel_format
        image = stem.with_suffix(IMAGE_SUFFIX)
        target = stem.with_suffix(CHANNELS_SUFFIX)
        if frame.channels and files is not ChannelFormat.NPY and not is_written(target):
            write_exr(target, frame.channels, None, frame.metadata)
        if frame.channels and files is not ChannelFormat.AUTO:
            has_ray = frame.valid if frame.has_ray is None else frame.has_ray
            write_sidecars(image, frame.channels, None, frame.metadata, has_ray, ChannelFormat.NPY)
        target = stem.with_suffix(BOXES_SUFFIX)
        instances, labels = frame.channels.get("instance"), frame.labels
        if instances is not None and labels is not None and not is_written(target):
            write_json(target, coco_image(instances, labels, image.name, self.number))
        target = stem.with_suffix(BOXES_3D_SUFFIX)
        if frame.boxes_3d is not None and labels is not None and not is_written(target):
            write_json(target, boxes_json(frame.boxes_3d, labels, image.name, frame.metadata))
        if not is_written(image):
            dataclasses.replace(frame, channels={}, boxes_3d=None).save(image)


class Renderer(BatchRenderer[RecordedFrame]):
    """Renders the images of a camera on a stage; see `Instrument`.

    Args:
        stage: stage of the renderer, to be closed after it.
        sensor: omnidirectional camera.
        mount: its mount on a vehicle of the stage.
    """

    def __init__(self, stage: SharedScene, sensor: OmniCamera, mount: Mount[object]):
        self._last_poses: ScenePoses | None = None
        mounted = sensor.mounted(mount.base_from_sensor)
        super().__init__(stage, mounted.seeing(scene_size_m(stage.scene)), mount)

    def _open_passes(self, hidden: frozenset[ObjectPart]) -> CameraBackend:
        vehicles = tuple(self._stage.vehicles)
        return self._stage.backend.camera(
            CameraSetup(self.sensor, self.mount.unlit, hidden, self.mount.seed, vehicles)
        )

    def render(
        self,
        state: WorldState | ArrayLike | None = None,
        linear: bool = False,
        *,
        optical: ArrayLike | None = None,
        also: Collection[ChannelName | str] = (),
        next_state: WorldState | ArrayLike | None = None,
        previous_state: WorldState | ArrayLike | None = None,
        motion: Motion | None = None,
        frame_number: int = 0,
        exposure_ev: float | None = None,
        boxes_3d: bool = False,
    ) -> Frame:
        """Render one frame.

        Args:
            state: world state in the middle of the frame; or, if nothing else moves, the pose (4,
                4) of the vehicle at 0 s, see `OmniCamera.base_pose`.
            optical: (4, 4) world_from_optical instead of `state`: the camera's own pose as in
                OpenCV and Kalibr, x right, y down, z forward.
            linear: also read back linear floats, for EXR files.
            also: names of ground-truth channels, see `omnisim.ground_truth`.
            next_state: state or pose at the next frame, for flow and scene flow.
            previous_state: state or pose at the previous frame, for backward flow.
            motion: world states around the frame's time, for motion blur and rolling shutter; None:
                at rest.
            frame_number: seeds the noise, which differs between frames.
            exposure_ev: exposure instead of auto-exposure; None: metered in this image, as if
                settled.
            boxes_3d: also compute oriented boxes of the visible instances.

        Raises:
            OmnisimError: both or neither of state and optical, an invalid pose, an unknown channel,
                flow without its other state, an impossible exposure, or the renderer or its stage
                is closed.
        """
        return self.submit(
            state,
            linear,
            optical=optical,
            also=also,
            next_state=next_state,
            previous_state=previous_state,
            motion=motion,
            frame_number=frame_number,
            exposure_ev=exposure_ev,
            boxes_3d=boxes_3d,
        ).result()

    def submit(
        self,
        state: WorldState | ArrayLike | None = None,
        linear: bool = False,
        *,
        optical: ArrayLike | None = None,
        also: Collection[ChannelName | str] = (),
        next_state: WorldState | ArrayLike | None = None,
        previous_state: WorldState | ArrayLike | None = None,
        motion: Motion | None = None,
        frame_number: int = 0,
        exposure_ev: float | None = None,
        boxes_3d: bool = False,
    ) -> PendingFrame:
        """Begin to render one frame, see `render`, without waiting for its image.

        Its `result` waits and returns the frame. Three may be in progress, and a fourth first waits
        for the oldest: while the GPU draws the next frame, the last one can be encoded and written.
        Ground truth is computed at once, as are images of back end "rays".
        """
        names = check_channels(also)
        now = self._state(self._state_or_optical(state, optical))
        others = {
            other: self._state(given, now)
            for other, given in (("next", next_state), ("previous", previous_state))
            if given is not None
        }
        needed = needed_others(names, others, "state")
        channels, labels, has_ray, boxes = {}, None, None, None
        with self._current() as passes:
            poses = self._poses_in(now)
            around = None if motion is None else partial(self._poses_at, motion, now)
            pending = passes.begin(FrameRequest(poses, around, linear, frame_number, exposure_ev))
            if names or boxes_3d:
                ground_truth = passes.ground_truth(names)
                other_poses = {other: self._poses_in(others[other]) for other in needed}
                channel_names = (
                    check_channels((*names, "position", "instance")) if boxes_3d else names
                )
                computed = ground_truth.channels(channel_names, poses, other_poses)
                labels, has_ray = ground_truth.labels, ground_truth.has_ray
                channels = {name: computed[name] for name in names}
                if boxes_3d:
                    full = self._boxes_in(poses, labels)
                    from omnisim.ground_truth.boxes_3d import visible_boxes

                    boxes = visible_boxes(computed["position"], computed["instance"], labels, full)
        self._last_poses = poses
        metadata = self._frame_metadata(now, poses.world_from_rig)
        bases = {
            f"{other}_world_from_base": others[other].world_from_object[self.vehicle].tolist()
            for other in needed
        }

        def finish() -> Frame:
            with self._current():
                image, degradation = pending.result()
            values = metadata | degradation | bases
            return Frame(image.rgba, image.linear, values, channels, labels, has_ray, boxes)

        return Pending(finish)

    def _state_or_optical(
        self, state: WorldState | ArrayLike | None, optical: ArrayLike | None
    ) -> WorldState | ArrayLike:
        """State, or the pose of the vehicle whose camera has the pose `optical` (4, 4)."""
        if optical is None and state is not None:
            return state
        if optical is None or state is not None:
            actual = "neither" if optical is None else "both"
            raise OmnisimError(f"render: expected either state or optical, got {actual}")
        return check_pose(optical) @ inverse(self.camera.base_from_optical)

    def begin(self, moment: Moment) -> Pending[RecordedFrame]:
        """Begin to render the image at a moment; auto-exposure follows the previous image's."""
        mount, is_ideal = self.mount, self.camera.degradation.is_ideal

        def motion(time_s: float) -> WorldState | NDArray[np.float64]:
            return moment.motion(time_s + mount.time_shift_s)

        pending = self.submit(
            motion(moment.time_s),
            also=moment.channels,
            boxes_3d=mount.boxes_3d,
            next_state=None if moment.next_s is None else motion(moment.next_s),
            previous_state=None if moment.previous_s is None else motion(moment.previous_s),
            motion=None if is_ideal else motion,
            frame_number=moment.number,
            exposure_ev=self._exposure_ev(moment),
        )
        return pending.then(
            lambda frame: RecordedFrame(frame, moment.number, ChannelFormat(mount.channel_format))
        )

    def _exposure_ev(self, moment: Moment) -> float | None:
        """Exposure reached by auto-exposure, EV; None: the image itself determines it."""
        degradation = self.camera.degradation
        if degradation.exposure is None or not degradation.is_metered:
            return None
        if moment.previous_stem is None or moment.previous_s is None:
            return None
        path = moment.previous_stem.with_suffix(IMAGE_SUFFIX)
        metadata = None if moment.previous is None else moment.previous.result().metadata
        try:
            if metadata is None:
                _, metadata = read_image(path)
            exposure = (metadata or {})["degradation"]["exposure"]
            ev, metered_ev = float(exposure["ev"]), float(exposure["metered_ev"])
        except (OmnisimError, KeyError, TypeError, ValueError):
            raise RunError(
                f"{path}: has no exposure, which the next image's follows from: remove it, and it "
                "is taken again"
            ) from None
        return degradation.exposure.next_ev(ev, metered_ev, moment.time_s - moment.previous_s)

    def faces(self) -> dict[str, NDArray[np.uint8]]:
        """Images (size, size, 3) uint8 sRGB of the virtual cameras in the last frame, by name.

        They are rendered for this call: a frame renders only the tiles that its image samples.

        Raises:
            GraphicsError: no frame yet, or the renderer or its stage is closed.
        """
        with self._current() as passes:
            if self._last_poses is None:
                raise GraphicsError("there are no faces yet: render a frame first")
            linear = passes.faces(self._last_poses)
        return {name: srgb8_from_linear(pixels) for name, pixels in linear.items()}

    def _poses_at(self, motion: Motion, now: WorldState, seconds_after: float) -> ScenePoses:
        """Poses in the motion of the world, some seconds after a world state."""
        time_s = now.time_s + seconds_after
        return self._poses_in(self._state(motion(time_s), now, time_s))

    def _boxes_in(self, poses: ScenePoses, labels: Labels) -> dict[int, OrientedBox]:
        """Boxes of all instances by ID at given poses, world frame."""
        stage = self._stage
        world_from_object = dict(zip(stage.objects, poses.world_from_objects, strict=True))
        time_s, boxes = time_of(poses.world_from_objects), {}
        of_scenes = {name: one.boxes_at(time_s) for name, one in stage.objects.items()}
        of_static = stage.scene.boxes_at(time_s)
        for label in labels.instances:
            owner = label.object_name
            box = (of_static if owner is None else of_scenes[owner]).get(label.name)
            if box is not None:
                world = box if owner is None else box.transformed(world_from_object[owner])
                boxes[label.id] = world
        return boxes

    def _frame_metadata(
        self, state: WorldState, world_from_rig: NDArray[np.float64]
    ) -> dict[str, Any]:
        world_from_optical = world_from_rig.copy()
        world_from_optical[:3, :3] = world_from_rig[:3, :3] @ self.camera.model.rig_from_optical
        backend_name = self._stage.backend_name
        return self._metadata(
            camera=self.camera.model.parameters(),
            polygons=self.camera.mesh_polygons or "exact",
            supersampling=self.camera.supersampling,
            lit=not self.mount.unlit,
            **({} if backend_name == "cube" else {"backend": backend_name}),
            exposure=self.scene.lighting.exposure,
            world_from_base=state.world_from_object[self.vehicle].tolist(),
            world_from_optical=world_from_optical.tolist(),
        )
