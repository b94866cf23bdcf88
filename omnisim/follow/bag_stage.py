"""Stage that follows the transforms of a recorded bag: of Gazebo, of Isaac Sim, of a real robot."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from omnisim.core.arrays import Floats
from omnisim.core.errors import SceneError, did_you_mean
from omnisim.core.files.ros_bag import open_bag
from omnisim.core.poses import interpolate_pose, pose_from_rotation, rotation_from_quaternion
from omnisim.core.world import WorldState
from omnisim.follow.body_stage import BodyStage
from omnisim.rendering.shared_scene import BackendName
from omnisim.scene import Scene
from omnisim.scene.labels import BODY

TRANSFORMS = ("tf2_msgs/msg/TFMessage", "tf/msg/tfMessage")
MAX_DEPTH = 200  # frames from the fixed one to a body


class _Frame(NamedTuple):
    """Frame of a transform tree, over time."""

    parent: str
    times_s: Floats  # (n,), ascending
    parent_from_frame: Floats  # (n, 4, 4)


class BagStage(BodyStage):
    """Stage whose bodies are the frames of a bag's `/tf` and `/tf_static`, of ROS 1 or ROS 2.

    Poses between two stamps are interpolated; before the first and after the last one they rest.

    Args:
        bag: folder or file of a bag.
        scene, robots, device, backend: as for `BodyStage`.
        fixed_frame: frame that is the scene's world; None: the only one without a parent.

    Attributes:
        times_s: stamps (n,) of all moving transforms; pass one of them, or any time between, to
            `at`.

    Raises:
        SceneError: a missing or damaged bag, one without transforms, or an unknown fixed frame.
        OmnisimError: as for `BodyStage`.
    """

    shows_all = False  # many frames have no shape

    def __init__(
        self,
        bag: str | Path,
        scene: Scene | str | Path,
        robots: Mapping[str, Scene | str | Path] | None = None,
        *,
        fixed_frame: str | None = None,
        device: int | str | None = None,
        backend: BackendName = "cube",
    ):
        self._frames = read_frames(Path(bag))
        roots = sorted({frame.parent for frame in self._frames.values()} - self._frames.keys())
        if fixed_frame is None and len(roots) != 1:
            raise SceneError(
                f"{bag}: frames without a parent: {', '.join(roots) or 'none'}: choose one of them "
                "as fixed_frame"
            )
        self._fixed = roots[0] if fixed_frame is None else fixed_frame
        if self._fixed not in {*roots, *self._frames}:
            known = did_you_mean(self._fixed, (*roots, *self._frames), "frames:")
            raise SceneError(f"{bag}: fixed_frame = {self._fixed!r}: {known}")
        names = [name for name in self._frames if self._chain(name)]
        stamps = [self._frames[name].times_s for name in names]
        self.times_s = np.unique(np.concatenate(stamps)) if stamps else np.zeros(0)
        self.times_s = self.times_s[np.isfinite(self.times_s)]
        super().__init__(scene, robots, names=names, device=device, backend=backend)

    def at(self, time_s: float) -> WorldState:
        """State of the world at a time in seconds, as the bag's stamps have it; also a `Motion`."""
        known: dict[str, Floats] = {self._fixed: np.eye(4)}

        def pose_of(name: str) -> Floats:
            if name not in known:
                frame = self._frames[name]
                known[name] = pose_of(frame.parent) @ _interpolated(frame, time_s)
            return known[name]

        return WorldState({BODY: np.eye(4), **{name: pose_of(name) for name in self.names}}, time_s)

    def _chain(self, name: str) -> bool:
        """Tell whether the fixed frame is above a frame."""
        for _ in range(MAX_DEPTH):
            if name == self._fixed or name not in self._frames:
                break
            name = self._frames[name].parent
        return name == self._fixed


def _interpolated(frame: _Frame, time_s: float) -> Floats:
    index = int(np.searchsorted(frame.times_s, time_s, side="right"))
    if index in (0, len(frame.times_s)):
        return frame.parent_from_frame[min(index, len(frame.times_s) - 1)]
    before, after = frame.times_s[index - 1 : index + 1]
    share = float((time_s - before) / (after - before))
    first, second = frame.parent_from_frame[index - 1 : index + 1]
    return interpolate_pose(first, second, share)


def read_frames(bag: Path) -> dict[str, _Frame]:
    """Read the frames of all transforms in a bag, by name; static ones have one time, −inf.

    Raises:
        SceneError: a missing or damaged bag, no transforms, or one that is not a pose.
    """
    found: dict[str, tuple[str, list[tuple[float, list[float]]]]] = {}
    with open_bag(bag, SceneError) as reader:
        used = [topic for topic in reader.connections if topic.msgtype in TRANSFORMS]
        for connection, _, data in reader.messages(used) if used else ():
            is_static = connection.topic.endswith("tf_static")
            message: Any = reader.deserialize(data, connection.msgtype)
            for stamped in message.transforms:
                stamp, place = stamped.header.stamp, stamped.transform
                time_s = -np.inf if is_static else stamp.sec + 1e-9 * stamp.nanosec
                vector, turn = place.translation, place.rotation
                numbers = [vector.x, vector.y, vector.z, turn.x, turn.y, turn.z, turn.w]
                name = stamped.child_frame_id.lstrip("/")
                parent = stamped.header.frame_id.lstrip("/")
                found.setdefault(name, (parent, []))[1].append((time_s, numbers))
    if not found:
        raise SceneError(f"{bag}: expected transforms (/tf), got none")
    frames = {}
    for name, (parent, samples) in found.items():
        times_s, kept = np.unique([time_s for time_s, _ in samples], return_index=True)
        values = np.array([samples[index][1] for index in kept])
        if not (np.isfinite(values).all() and (np.linalg.norm(values[:, 3:], axis=1) > 0).all()):
            raise SceneError(f"{bag}: frame {name!r}: expected finite transforms and rotations")
        poses = pose_from_rotation(rotation_from_quaternion(values[:, 3:]), values[:, :3])
        frames[name] = _Frame(parent, times_s, poses)
    return frames
