"""Batches: images and ground truth of many world states in one submission."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
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
from omnisim.rendering.instrument import Instrument, ReadingT_co
from omnisim.rendering.readback import Pending, ScenePoses

# World states, or vehicle poses (n, 4, 4) if nothing else moves.
States = Sequence[WorldState | ArrayLike] | ArrayLike
Arrays = Mapping[str, NDArray[Any]]
PendingBatch = Pending[dict[str, NDArray[Any]]]


class BatchRenderer(Instrument[OmniCamera, CameraBackend, ReadingT_co]):
    """Renders batches of a camera."""

    _last_poses: ScenePoses | None

    @property
    def camera(self) -> OmniCamera:
        """The sensor, with the near plane for this scene."""
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
        names = check_contents(channels)
        poses = self._batch_poses(states)
        others = self._other_poses(names, {"next": next_states, "previous": previous_states})
        for other, some in others.items():
            if len(some) != len(poses):
                raise OutputError(f"{other}_states: expected {len(poses)}, got {len(some)}")
        model = self.camera.model
        arrays = batch_arrays(names, (len(poses), model.height_px, model.width_px), out)
        truth = {name: array for name, array in arrays.items() if name in CHANNELS}
        with self._current() as passes:
            begun = [
                passes.begin_batch(poses, arrays[one], frame_number)
                for one in IMAGES
                if one in arrays
            ]
            if truth:
                fill_channels(passes, truth, poses, others)
        self._last_poses = poses[-1] if poses else self._last_poses

        def finish() -> dict[str, NDArray[Any]]:
            with self._current():
                for one in begun:
                    one.result()
            return arrays

        return Pending(finish)

    def _other_poses(
        self, names: Collection[str], states: Mapping[str, States | None]
    ) -> dict[str, list[ScenePoses]]:
        """Poses of the "next" and the "previous" images that the channels need."""
        given = {other: some for other, some in states.items() if some is not None}
        needed = needed_others([name for name in names if name in CHANNELS], given, "states")
        return {other: self._batch_poses(given[other]) for other in needed}

    def _batch_poses(self, states: States) -> list[ScenePoses]:
        """Poses of the camera and of all dynamic objects, per state.

        Raises:
            OmnisimError: an invalid pose.
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
        """Poses of the camera and of all dynamic objects in a world state."""
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
        passes: back end of the camera.
        arrays: arrays by channel name.
        poses: poses of the camera and the objects, one entry per image.
        others: poses of the "next" and the "previous" images, if channels need them.
    """
    truth = passes.ground_truth(arrays)
    for number, channels in enumerate(truth.batch(tuple(arrays), poses, others)):
        for name, values in channels.items():
            arrays[name][number] = values


def needed_others(names: Collection[str], given: Collection[str], what: str) -> list[str]:
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
