"""Batches: images and ground truth of many states of the world, drawn together."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from functools import partial
from typing import Any, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from omnisim.core.errors import OutputError
from omnisim.core.poses import check_poses
from omnisim.core.world import WorldState
from omnisim.ground_truth import CHANNELS
from omnisim.rendering.backend import CameraBackend
from omnisim.rendering.batch_arrays import IMAGES, batch_arrays, check_contents
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.readback import ScenePoses
from omnisim.rendering.sensor_renderer import SensorRenderer

# States of the world, or poses (n, 4, 4) of the vehicle, where nothing else moves.
States = Sequence[WorldState | ArrayLike] | ArrayLike
Arrays = Mapping[str, NDArray[Any]]


class PendingBatch:
    """Batch that is drawn and may still be read, see `omnisim.Renderer.begin_batch`.

    Args:
        arrays: by name, not yet filled.
        finish: fills them; None: they are.
    """

    def __init__(self, arrays: dict[str, NDArray[Any]], finish: Callable[[], None] | None):
        self._arrays, self._finish = arrays, finish

    def result(self) -> dict[str, NDArray[Any]]:
        """Wait, and return arrays (n, height, width, …) by name.

        Raises:
            GraphicsError: the renderer was closed before.
        """
        if self._finish is not None:
            self._finish()
            self._finish = None
        return self._arrays


class BatchRenderer(SensorRenderer[OmniCamera, CameraBackend]):
    """Renders batches of a camera."""

    _last_poses: ScenePoses | None

    @property
    def camera(self) -> OmniCamera:
        """The sensor, whose near plane suits the scene."""
        return self.sensor

    @overload
    def render_batch(
        self,
        states: States,
        *,
        channels: None = None,
        out: NDArray[np.uint8] | None = None,
        frame_number: int = 0,
    ) -> NDArray[np.uint8]: ...

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
    ) -> NDArray[np.uint8] | dict[str, NDArray[Any]]:
        """Render images (n, height, width, 3) uint8, sRGB, of n states in one submission.

        They are those of n single frames, byte for byte. Memory is bounded: many are drawn slice
        by slice. Arrays are contiguous and writeable, as DLPack needs them.

        Args:
            states: n, each as for `render`; poses are quickest as one array (n, 4, 4).
            channels: names of channels of ground truth, and "rgb" or "rgba"; the result is then
                arrays (n, height, width, …) by name. None: the image alone.
            out: arrays to fill and return, by name; or that of the only name.
            next_states: n, which flow and scene flow need.
            previous_states: n, for backward flow.
            frame_number: of the first image; noise differs from image to image. The world is
                at rest in each.

        Raises:
            OmnisimError: as `render`; or an array of another shape, type or layout.
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
        """Begin to render a batch, see `render_batch`, and do not wait for its images.

        Several cameras of a stage, of a rig or of a team, are drawn together so: begin with each,
        then take each `PendingBatch.result`. A renderer's next batch ends the one before.
        """
        names = check_contents(channels)
        poses = self._batch_poses(states)
        others = self._other_poses(names, {"next": next_states, "previous": previous_states})
        for other, some in others.items():
            if len(some) != len(poses):
                raise OutputError(f"{other}_states: expected {len(poses)}, got {len(some)}")
        model = self.camera.model
        arrays = batch_arrays(names, (len(poses), model.height_px, model.width_px), out)
        truth = {name: array for name, array in arrays.items() if name in CHANNELS}
        end: Callable[[], None] | None = None
        with self._current() as passes:
            for array in (arrays[name] for name in IMAGES if name in arrays):
                end = passes.begin_batch(poses, array, frame_number)
            if truth:
                fill_channels(passes, truth, poses, others)
        self._last_poses = poses[-1] if poses else self._last_poses
        return PendingBatch(arrays, None if end is None else partial(self._end_batch, end))

    def _end_batch(self, end: Callable[[], None]) -> None:
        with self._current():
            end()

    def _other_poses(
        self, names: Collection[str], states: Mapping[str, States | None]
    ) -> dict[str, list[ScenePoses]]:
        """Poses of the "next" and the "previous" images that channels of some names need."""
        given = {other: some for other, some in states.items() if some is not None}
        needed = needed_others([name for name in names if name in CHANNELS], given, "states")
        return {other: self._batch_poses(given[other]) for other in needed}

    def _batch_poses(self, states: States) -> list[ScenePoses]:
        """Poses of the camera and of all that moves, in each state.

        Raises:
            OmnisimError: one that is not a pose.
        """
        if isinstance(states, Sequence) and any(isinstance(one, WorldState) for one in states):
            return [self._poses_in(self._state(one)) for one in states]
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
        """Poses of the camera and of all that moves, in a state of the world."""
        world_from_base = state.world_from_object[self.vehicle]
        return ScenePoses(world_from_base @ self.camera.base_from_rig, self._stage.poses_in(state))


def fill_channels(
    passes: CameraBackend,
    arrays: Arrays,
    poses: Sequence[ScenePoses],
    others: Mapping[str, Sequence[ScenePoses]],
) -> None:
    """Fill arrays (n, height, width, …) of channels.

    Args:
        passes: of the camera.
        arrays: by the channels' names.
        poses: of each image.
        others: those of the "next" and the "previous" images, where channels need them.
    """
    truth = passes.ground_truth(arrays)
    for number, channels in enumerate(truth.batch(tuple(arrays), poses, others)):
        for name, values in channels.items():
            arrays[name][number] = values


def needed_others(names: Collection[str], given: Collection[str], what: str) -> list[str]:
    """Other images that channels of these names depend on: "next", "previous".

    Args:
        names: of channels.
        given: other images whose states are.
        what: ending of the argument's name.

    Raises:
        OutputError: the state at one is not given.
    """
    needed = {CHANNELS[name].other: name for name in reversed(tuple(names)) if CHANNELS[name].other}
    for other, name in needed.items():
        if other not in given:
            raise OutputError(f"channel {name!r}: expected {other}_{what}, got none")
    return sorted(needed)
