"""Stage that follows a simulation of MuJoCo, or of MuJoCo Warp; needs the extra `mujoco`."""

from __future__ import annotations

import copy
from collections.abc import Collection, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from omnisim.cameras import PerspectiveCamera, UnifiedCamera
from omnisim.core.arrays import Floats
from omnisim.core.errors import OmnisimError, printable
from omnisim.core.extras import require_extra
from omnisim.core.world import Motion, WorldState
from omnisim.follow.body_stage import NO_BODY, BodyStage
from omnisim.ground_truth.frame import Frame
from omnisim.rendering.shared_scene import BackendName
from omnisim.scene.light.lighting import DEFAULT_BACKGROUND, DEFAULT_LIGHTING
from omnisim.scene.model import Scene, StartPose

if TYPE_CHECKING:
    import mujoco

    from omnisim.scene.formats.mjcf.reader import ModelMount

VISIBLE_GROUPS = (0, 1, 2)  # shown by MuJoCo's own renderer
NO_GEOM = NO_BODY


class MujocoStage(BodyStage):
    """Stage whose objects are the bodies of a MuJoCo model.

    Geometry, materials and lights are read once; lamps stay where they are. Sensors are opened as
    on any stage. Their `vehicle` is a body, or a site or camera of the model, as "site/NAME" or
    "camera/NAME": x forward, z up; a camera of the model looks along its −z.

    Args:
        model: `mujoco.MjModel`.
        data: its `mujoco.MjData`; or for many worlds a sequence of them, or MuJoCo Warp's data. The
            poses are computed, as after `mj_forward` or `mj_step`.
        groups: groups of the drawn geoms.
        hidden: names of geoms that stay invisible, see `geoms`.
        device, backend: as for `omnisim.Stage`.

    Attributes:
        names: bodies, in the model's order; the first is the world.
        geoms: geom index of each instance, by the instance's name (`body/geom`).
        notices: one line for each unsupported feature of the model.

    Raises:
        SceneError: an unknown name in `hidden`.
        OmnisimError: MuJoCo is not installed, or as for `omnisim.Stage`.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        data: Any,
        *,
        groups: Collection[int] = VISIBLE_GROUPS,
        hidden: Collection[str] = (),
        device: int | str | None = None,
        backend: BackendName = "cube",
    ):
        require_extra("mujoco", "MujocoStage")
        import mujoco

        from omnisim.scene.formats.mjcf.reader import ModelReader, body_names, compute_poses

        self._model, self._groups = model, tuple(groups)
        self._data: Any = [data] if isinstance(data, mujoco.MjData) else data
        is_read = isinstance(self._data, Sequence)
        if not isinstance(model, mujoco.MjModel) or not (
            data if is_read else hasattr(data, "xpos")
        ):
            given = f"{type(model).__name__} and {type(data).__name__}"
            raise OmnisimError(f"expected an MjModel and its MjData, got {given}")
        first = copy.copy(self._data[0]) if is_read else mujoco.MjData(model)
        compute_poses(model, first)  # also before the first step
        reader = ModelReader(model, first, groups, hidden)
        read = reader.read()
        scene = Scene(
            "mujoco", read.meshes, read.materials, read.instances,
            read.lighting or DEFAULT_LIGHTING, read.background or DEFAULT_BACKGROUND,
            StartPose((0.0, 0.0, 0.0)), notices=tuple(map(printable, read.notices)),
            links=read.links,
        )  # fmt: skip
        self.geoms = {name: geom for geom, name in enumerate(reader.names)}
        self._mounts: dict[str, ModelMount] = {}
        super().__init__(scene, names=body_names(model), device=device, backend=backend)
        self._rest.clear()  # the order of quaternions is known

    def carrier(self, name: str | None) -> str:
        """Body, site or camera that carries a sensor; without one, the world.

        Raises:
            SceneError: none of this name.
        """
        kind, _, own = (name or "").partition("/")
        if name is None or name in self.names or kind not in ("site", "camera"):
            return super().carrier(name)
        from omnisim.scene.formats.mjcf.reader import find_mount

        self._mounts[name] = find_mount(self._model, kind, own)
        return name

    def lens_of(
        self, camera: str, size_px: tuple[int, int] | None = None
    ) -> PerspectiveCamera | UnifiedCamera:
        """Pinhole lens of a camera of the model; omnisim's images then match MuJoCo's.

        Without `size_px` (width, height) it has the camera's resolution, or else 640 × 480.

        Raises:
            SceneError: an unknown or an orthographic camera.
            OpticsError: a size below 1.
        """
        from omnisim.scene.formats.mjcf.reader import lens_of

        return lens_of(self._model, camera, size_px)

    def now(self) -> WorldState:
        """State at the moment of the data, copied: later steps do not change it.

        Skins and flexible bodies take their present shape, for all states.

        Raises:
            OmnisimError: several worlds, or as for `state`.
        """
        state = self.state(self._one("xpos"), self._one("xquat"), float(self._one("time")))
        if (self._model.nskin or self._model.nflex) and isinstance(self._data, Sequence):
            from omnisim.scene.formats.mjcf.reader import deformed

            self.scene = deformed(self.scene, self._model, self._data[0], self._groups)
        return state

    def worlds_now(self) -> list[WorldState]:
        """States of all worlds; skins and flexible bodies keep their shape.

        Raises:
            OmnisimError: as for `states`.
        """
        return self.states(self._read("xpos"), self._read("xquat"), self._read("time"))

    def motion_now(self) -> Motion:
        """Motion of the bodies around the moment of the data.

        Raises:
            OmnisimError: several worlds, or as for `motion`.
        """
        positions, velocities = self._one("xpos"), self._one("cvel")
        # cvel is that of the point of each body that is at its tree's center of mass
        arms = positions - self._one("subtree_com")[self._model.body_rootid]
        angular, linear = velocities[:, :3], velocities[:, 3:]
        return self.motion(
            positions, self._one("xquat"), linear=linear + np.cross(angular, arms),
            angular=angular, time_s=float(self._one("time")),
        )  # fmt: skip

    def body_ids(self, frame: Frame) -> NDArray[np.int32]:
        """Index (height, width) in `names` of each pixel's body; −1 for the world and the sky.

        Raises:
            OmnisimError: the frame was rendered without the channel instance.
        """
        geoms = self.geom_ids(frame)
        bodies = np.where(geoms == NO_GEOM, 0, self._model.geom_bodyid[geoms])
        return np.where(bodies > 0, bodies, NO_BODY)

    def geom_ids(self, frame: Frame) -> NDArray[np.int32]:
        """Geom IDs (height, width) of a frame's pixels; −1 where no geom is visible.

        Raises:
            OmnisimError: the frame was rendered without the channel instance.
        """
        return self._ids(frame, "geom_ids", lambda one: self.geoms.get(one.name, NO_GEOM))

    def _read(self, field: str) -> Floats:
        """Array of the data, (worlds, …)."""
        if isinstance(self._data, Sequence):
            return np.array([getattr(one, field) for one in self._data])
        values: Floats = getattr(self._data, field).numpy()
        return values

    def _one(self, field: str) -> Floats:
        values = self._read(field)
        if len(values) > 1:
            raise OmnisimError(f"data: expected one world, got {len(values)}: see worlds_now")
        return values[0]

    def _states(self, poses: Floats, time_s: ArrayLike) -> list[WorldState]:
        states, carried = super()._states(poses, time_s), {}
        for name, mount in self._mounts.items():
            carried[name] = list(poses[:, mount.body] @ mount.body_from_mount)
            if mount.is_tracking:
                from omnisim.scene.formats.mjcf.reader import tracked_pose

                axes = zip(self._read("cam_xpos"), self._read("cam_xmat"), strict=True)
                carried[name] = [
                    tracked_pose(at[mount.number], by[mount.number]) for at, by in axes
                ]
        return [
            WorldState.of_checked(
                {**state.world_from_object, **{name: of[world] for name, of in carried.items()}},
                state.time_s,
            )
            for world, state in enumerate(states)
        ]
