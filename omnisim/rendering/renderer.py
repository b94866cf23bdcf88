"""Renderer of a camera in a scene: poses in, frames and batches out."""

from __future__ import annotations

import dataclasses
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from omnisim.core.arrays import Bytes, Floats
from omnisim.core.errors import GraphicsError, OmnisimError, OutputError, RunError
from omnisim.core.files.atomic_file import is_written
from omnisim.core.files.image_files import read_image
from omnisim.core.pending import Pending
from omnisim.core.poses import check_pose, check_poses, inverse
from omnisim.core.srgb import srgb8_from_linear
from omnisim.core.world import Motion, ObjectPart, WorldState, time_of
from omnisim.ground_truth import CHANNELS, Labels, check_channels
from omnisim.ground_truth.channel_files import ChannelFormat, write_sidecars
from omnisim.ground_truth.channels import ChannelName
from omnisim.ground_truth.frame import Frame
from omnisim.rendering.camera.omnicamera import (
    BOXES_3D_SUFFIX,
    BOXES_SUFFIX,
    CHANNELS_SUFFIX,
    IMAGE_SUFFIX,
    OmniCamera,
)
from omnisim.rendering.camera.quality import scene_size_m
from omnisim.rendering.contract import (
    CameraBackend,
    CameraSetup,
    FrameRequest,
    FrameStatistics,
    ScenePoses,
)
from omnisim.rendering.instrument import Instrument
from omnisim.rendering.sensor import Moment, Mount
from omnisim.rendering.shared_scene import SharedScene

if TYPE_CHECKING:
    from omnisim.ground_truth.boxes import OrientedBox

PendingFrame = Pending[Frame]
# World states, or vehicle poses (n, 4, 4) if nothing else moves.
States = Sequence[WorldState | ArrayLike] | ArrayLike
Arrays = Mapping[str, NDArray[Any]]
PendingBatch = Pending[dict[str, NDArray[Any]]]
IMAGES = {"rgb": 3, "rgba": 4}  # components per pixel


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
        from omnisim.ground_truth.boxes import boxes_json, coco_image, write_json
        from omnisim.ground_truth.channel_files import write_exr

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


class Renderer(Instrument[OmniCamera, CameraBackend, RecordedFrame]):
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

    @property
    def camera(self) -> OmniCamera:
        """The sensor, with the near plane for this scene."""
        return self.sensor

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
        needed = _needed_others(names, others, "state")
        channels, labels, has_ray, boxes = {}, None, None, None
        with self._current() as passes:
            poses = self._poses_in(now)
            around = None if motion is None else partial(self._poses_at, motion, now)
            pending = passes.begin(FrameRequest(poses, around, linear, frame_number, exposure_ev))
            if names or boxes_3d:
                from omnisim.rendering.truth import ground_truth_of

                ground_truth = ground_truth_of(passes, names)
                other_poses = {other: self._poses_in(others[other]) for other in needed}
                channel_names = (
                    check_channels((*names, "position", "instance")) if boxes_3d else names
                )
                computed = ground_truth.channels(channel_names, poses, other_poses)
                labels, has_ray = ground_truth.labels, ground_truth.has_ray
                channels = {name: computed[name] for name in names}
                if boxes_3d:
                    full = self._boxes_in(poses, labels)
                    from omnisim.ground_truth.boxes import visible_boxes

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

    @overload
    def render_batch(
        self,
        states: States,
        *,
        channels: None = None,
        out: Bytes | None = None,
        frame_number: int = 0,
    ) -> Bytes: ...

    @overload
    def render_batch(
        self,
        states: States,
        *,
        channels: Collection[str],
        out: Arrays | NDArray[Any] | None = None,
        next_states: States | None = None,
        previous_states: States | None = None,
        frame_number: int = 0,
    ) -> dict[str, NDArray[Any]]: ...

    def render_batch(
        self,
        states: States,
        *,
        channels: Collection[str] | None = None,
        out: Arrays | NDArray[Any] | None = None,
        next_states: States | None = None,
        previous_states: States | None = None,
        frame_number: int = 0,
    ) -> Bytes | dict[str, NDArray[Any]]:
        """Render images (n, height, width, 3) uint8, sRGB, of n world states in one submission.

        They equal n single frames byte for byte. Memory is bounded: large batches are drawn slice
        by slice. The arrays are contiguous and writeable, as DLPack requires.

        Args:
            states: n states as for `render`; one array of poses (n, 4, 4) is fastest.
            channels: names of ground-truth channels, and "rgb" or "rgba"; the result is then a dict
                of arrays (n, height, width, …). None: the image alone.
            out: arrays to fill and return by name, or the array of the only name.
            next_states: n states, for flow and scene flow.
            previous_states: n states, for backward flow.
            frame_number: number of the first image; noise differs between images. The world is at
                rest in each.

        Raises:
            OmnisimError: as for `render`; or an array of another shape, type or layout.
        """
        names = ("rgb",) if channels is None else channels
        pending = self.begin_batch(
            states,
            channels=names,
            out=out,
            next_states=next_states,
            previous_states=previous_states,
            frame_number=frame_number,
        )
        return pending.result()["rgb"] if channels is None else pending.result()

    def begin_batch(
        self,
        states: States,
        *,
        channels: Collection[str] = ("rgb",),
        out: Arrays | NDArray[Any] | None = None,
        next_states: States | None = None,
        previous_states: States | None = None,
        frame_number: int = 0,
    ) -> PendingBatch:
        """Begin to render a batch, see `render_batch`, without waiting for its images.

        This way several cameras of a stage are drawn together: begin a batch with each, then call
        each one's `result`, which returns the arrays by name. A renderer has three batches, slices
        of large ones, or frames in progress; a further one first waits for the oldest.
        """
        names = _check_contents(channels)
        poses = self._batch_poses(states)
        others = self._other_poses(names, {"next": next_states, "previous": previous_states})
        for other, some in others.items():
            if len(some) != len(poses):
                raise OutputError(f"{other}_states: expected {len(poses)}, got {len(some)}")
        model = self.camera.model
        arrays = _batch_arrays(names, (len(poses), model.height_px, model.width_px), out)
        truth = {name: array for name, array in arrays.items() if name in CHANNELS}
        with self._current() as passes:
            begun = [
                passes.begin_batch(poses, arrays[image], frame_number)
                for image in IMAGES
                if image in arrays
            ]
            if truth:
                _fill_channels(passes, truth, poses, others)
        self._last_poses = poses[-1] if poses else self._last_poses

        def finish() -> dict[str, NDArray[Any]]:
            with self._current():
                for pending in begun:
                    pending.result()
            return arrays

        return Pending(finish)

    def begin(self, moment: Moment) -> Pending[RecordedFrame]:
        """Begin to render the image at a moment; auto-exposure follows the previous image's."""
        mount, is_ideal = self.mount, self.camera.degradation.is_ideal

        def motion(time_s: float) -> WorldState | Floats:
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
                f"{path}: has no exposure, from which the next image's follows: remove it to have "
                "it rendered again"
            ) from None
        return degradation.exposure.next_ev(ev, metered_ev, moment.time_s - moment.previous_s)

    def statistics(
        self, state: WorldState | ArrayLike | None = None, *, optical: ArrayLike | None = None
    ) -> FrameStatistics:
        """Numbers of triangles behind the frame of a state or pose, see `render`.

        Only this call counts: it draws the frame once more and casts its pixels' rays, which takes
        about as long as an image with ground truth.

        Raises:
            OmnisimError: as for `render`; or a scene that is too large for ground truth.
        """
        now = self._state(self._state_or_optical(state, optical))
        with self._current() as passes:
            return passes.statistics(self._poses_in(now))

    def faces(self) -> dict[str, Bytes]:
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

    def _open_passes(self, hidden: frozenset[ObjectPart]) -> CameraBackend:
        vehicles = tuple(self._stage.vehicles)
        return self._stage.backend.camera(
            CameraSetup(self.sensor, self.mount.unlit, hidden, self.mount.seed, vehicles)
        )

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

    def _other_poses(
        self, names: Collection[str], states: Mapping[str, States | None]
    ) -> dict[str, list[ScenePoses]]:
        """Poses of the "next" and the "previous" images that the channels need."""
        given = {other: some for other, some in states.items() if some is not None}
        needed = _needed_others([name for name in names if name in CHANNELS], given, "states")
        return {other: self._batch_poses(given[other]) for other in needed}

    def _batch_poses(self, states: States) -> list[ScenePoses]:
        """Poses of the camera and of all dynamic objects, per state.

        Raises:
            OmnisimError: an invalid pose.
        """
        if isinstance(states, Sequence) and any(isinstance(state, WorldState) for state in states):
            return [self._poses_in(self._state(state)) for state in states]
        world_from_bases = check_poses(states)
        if not len(world_from_bases):
            return []
        objects = self._poses_in(WorldState({self.vehicle: np.eye(4)})).world_from_objects
        rigs = world_from_bases @ self.camera.base_from_rig
        names = list(self._stage.objects)
        if self.vehicle not in names:
            return [ScenePoses(rig, objects) for rig in rigs]
        at = names.index(self.vehicle)
        before, after = objects[:at], objects[at + 1 :]
        return [
            ScenePoses(rig, (*before, base, *after))
            for rig, base in zip(rigs, world_from_bases, strict=True)
        ]

    def _poses_in(self, state: WorldState) -> ScenePoses:
        """Poses of the camera and of all dynamic objects in a world state."""
        world_from_base = state.world_from_object[self.vehicle]
        return ScenePoses(world_from_base @ self.camera.base_from_rig, self._stage.poses_in(state))

    def _poses_at(self, motion: Motion, now: WorldState, seconds_after: float) -> ScenePoses:
        """Poses in the motion of the world, some seconds after a world state."""
        time_s = now.time_s + seconds_after
        return self._poses_in(self._state(motion(time_s), now, time_s))

    def _boxes_in(self, poses: ScenePoses, labels: Labels) -> dict[int, OrientedBox]:
        """Boxes of all instances by ID at given poses, world frame."""
        stage = self._stage
        world_from_object = dict(zip(stage.objects, poses.world_from_objects, strict=True))
        time_s, boxes = time_of(poses.world_from_objects), {}
        of_scenes = {name: moving.boxes_at(time_s) for name, moving in stage.objects.items()}
        of_static = stage.scene.boxes_at(time_s)
        for label in labels.instances:
            owner = label.object_name
            box = (of_static if owner is None else of_scenes[owner]).get(label.name)
            if box is not None:
                world = box if owner is None else box.transformed(world_from_object[owner])
                boxes[label.id] = world
        return boxes

    def _frame_metadata(self, state: WorldState, world_from_rig: Floats) -> dict[str, Any]:
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


def _check_contents(names: Collection[str]) -> tuple[str, ...]:
    """Names in order: images first, then channels in the order of `CHANNELS`.

    Raises:
        OutputError: an unknown name, a string instead of names, or both images.
    """
    if isinstance(names, str):
        return check_channels(names)  # raises
    images = [name for name in IMAGES if name in names]
    if len(images) == len(IMAGES):
        raise OutputError("channels: expected one of rgb and rgba, got both")
    return (*images, *check_channels(name for name in names if name not in IMAGES))


def _batch_arrays(
    names: Collection[str],
    size: tuple[int, int, int],
    out: NDArray[Any] | Mapping[str, NDArray[Any]] | None,
) -> dict[str, NDArray[Any]]:
    """Arrays by name, contiguous and writeable.

    Args:
        names: names from `_check_contents`.
        size: number, height and width of the images.
        out: arrays of the caller by name, or the array of the only name; None: new arrays.

    Raises:
        OutputError: an array of another shape or type, a read-only one, or other names.
    """
    if out is None:
        return {name: np.empty(*_layout(name, size)) for name in names}
    if not isinstance(out, Mapping):
        if len(names) != 1:
            raise OutputError(f"out: expected arrays by name: {', '.join(names)}, got one array")
        return {name: _check("out", out, *_layout(name, size)) for name in names}
    if out.keys() != set(names):
        actual = ", ".join(map(str, out)) or "none"
        raise OutputError(f"out: expected arrays by name: {', '.join(names)}, got {actual}")
    return {name: _check(f"out[{name!r}]", out[name], *_layout(name, size)) for name in names}


def _layout(name: str, size: tuple[int, int, int]) -> tuple[tuple[int, ...], np.dtype[Any]]:
    """Shape and type of an array."""
    if name in IMAGES:
        return (*size, IMAGES[name]), np.dtype(np.uint8)
    channel = CHANNELS[name]
    parts = len(channel.layers)
    return (*size, parts) if parts > 1 else size, np.dtype(channel.dtype)


def _check(
    what: str, array: NDArray[Any], shape: tuple[int, ...], dtype: np.dtype[Any]
) -> NDArray[Any]:
    """Return the caller's array if it can be filled in place."""
    if isinstance(array, np.ndarray):
        faults = {
            f"type {array.dtype}": array.dtype == dtype,
            f"shape {array.shape}": array.shape == shape,
            "one that is not contiguous": array.flags.c_contiguous,
            "a read-only one": array.flags.writeable,
        }
        actual = next((fault for fault, is_right in faults.items() if not is_right), None)
    else:
        actual = type(array).__name__
    if actual is None:
        return array
    raise OutputError(
        f"{what}: expected a writeable, C-contiguous NumPy array of {dtype} and shape {shape}, "
        f"got {actual}"
    )


def _fill_channels(
    passes: CameraBackend,
    arrays: Arrays,
    poses: Sequence[ScenePoses],
    others: Mapping[str, Sequence[ScenePoses]],
) -> None:
    """Fill arrays (n, height, width, …) of channels.

    Args:
        passes: back end of the camera.
        arrays: arrays by channel name.
        poses: poses of the camera and the objects, one entry per image.
        others: poses of the "next" and the "previous" images, if channels need them.
    """
    from omnisim.rendering.truth import ground_truth_of

    truth = ground_truth_of(passes, arrays)
    for number, channels in enumerate(truth.batch(tuple(arrays), poses, others)):
        for name, values in channels.items():
            arrays[name][number] = values


def _needed_others(names: Collection[str], given: Collection[str], what: str) -> list[str]:
    """Other images required by the channels: "next", "previous".

    Args:
        names: channels.
        given: other images with known states.
        what: ending of the argument's name.

    Raises:
        OutputError: a required state is missing.
    """
    needed = {CHANNELS[name].other: name for name in reversed(tuple(names)) if CHANNELS[name].other}
    for other, name in needed.items():
        if other not in given:
            raise OutputError(f"channel {name!r}: expected {other}_{what}, got none")
    return sorted(needed)
