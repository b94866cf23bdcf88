"""Cameras of omnisim in your own MuJoCo simulation loop; needs the extra `mujoco`.

with omnisim.runs.mujoco_camera.Camera(model, data, "fisheye.toml", body="head") as camera:
    while data.time < 1.0:
        mujoco.mj_step(model, data)
        frame = camera.render(also=("range", "instance"))
"""

from __future__ import annotations

from collections.abc import Collection
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from omnisim.core.arrays import Floats
from omnisim.core.errors import OmnisimError
from omnisim.core.extras import require_extra
from omnisim.core.poses import check_pose
from omnisim.core.world import WorldState
from omnisim.ground_truth import Labels
from omnisim.ground_truth.frame import Frame
from omnisim.rendering.camera.omnicamera import CameraLike, OmniCamera
from omnisim.rendering.shared_scene import BackendName, Closeable
from omnisim.rendering.stage import Stage

if TYPE_CHECKING:
    import mujoco

    from omnisim.scene.formats.mjcf.reader import lens_of as lens_of

VISIBLE_GROUPS = (0, 1, 2)  # shown by MuJoCo's own renderer
NO_GEOM = -1


def __getattr__(name: str) -> object:
    if name == "lens_of":
        from omnisim.scene.formats.mjcf import reader  # needs the extra

        return reader.lens_of
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


class Camera(Closeable):
    """Any camera of omnisim in a MuJoCo simulation.

    The model's geometry, materials and lights are loaded once; each frame uses the current poses
    of the data. Skins and flexible bodies deform in each frame, but their deformation adds no
    flow. Lamps stay at their initial positions.

    Mount it on a body, a site or a camera of the model, whose forward and up directions it takes:
    x is forward and z up; a camera of the model looks along its −z. Without a mount it is fixed
    to the world.

    Args:
        model, data: `mujoco.MjModel` and `mujoco.MjData`; the poses of the data are computed, as
            after `mj_forward` or `mj_step`.
        sensor: the camera, as for `omnisim.Stage.open`; None: the lens of the model's camera on
            which it is mounted, or else the paper's camera.
        body, site, camera: name of the mount; at most one of them.
        pose: (4, 4) mount_from_base, or world_from_base without a mount; None: the identity.
        groups: groups of the drawn geoms.
        hidden: names of geoms that stay invisible, such as the camera's own housing; see `geoms`.
        unlit, device, seed, backend: as for `omnisim.open_sensor`.

    Attributes:
        sensor: the camera.
        notices: one line for each unsupported feature of the model.

    Raises:
        SceneError: a mount or hidden geom that is missing from the model, or several mounts.
        OmnisimError: an invalid pose, or as `omnisim.open_sensor`.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        data: mujoco.MjData,
        sensor: CameraLike = None,
        *,
        body: str | None = None,
        site: str | None = None,
        camera: str | None = None,
        pose: ArrayLike | None = None,
        groups: Collection[int] = VISIBLE_GROUPS,
        hidden: Collection[str] = (),
        unlit: bool = False,
        device: int | None = None,
        seed: int | str = 0,
        backend: BackendName = "cube",
    ):
        require_extra("mujoco", "omnisim.runs.mujoco_camera.Camera")
        from omnisim.scene.formats.mjcf.reader import find_mount, lens_of, split_model

        self._model, self._data, self._groups = model, data, tuple(groups)
        self._mount = find_mount(model, body=body, site=site, camera=camera)
        if sensor is None and camera is not None:
            sensor = lens_of(model, camera)
        self.sensor = OmniCamera.of(sensor)
        self._mount_from_base = np.eye(4) if pose is None else check_pose(pose)
        self._moving = split_model(model, data, groups, hidden)
        self.notices = self._moving.static.notices
        self._labels: Labels | None = None
        self._geoms = np.array([NO_GEOM], dtype=np.int32)
        self._stage = Stage(
            self._moving.static,
            dynamic_objects=self._moving.objects,
            device=device,
            backend=backend,
        )
        try:
            self._renderer = self._stage.open(self.sensor, unlit=unlit, seed=seed)
        except BaseException:
            self._stage.close()
            raise

    @property
    def world_from_base(self) -> Floats:
        """Pose (4, 4) of the sensor's base at the moment of the data."""
        if self._mount is None:
            return self._mount_from_base
        return self._mount.pose(self._data) @ self._mount_from_base

    def state(self) -> WorldState:
        """Time and poses of the data, copied: a later step of the simulation does not change them.

        `render` takes them for flow, as the state of the previous or of the next frame.
        """
        poses = dict(zip(self._moving.objects, self._moving.poses(self._data), strict=True))
        poses[self._renderer.vehicle] = self.world_from_base
        return WorldState(poses, float(self._data.time))

    def render(
        self,
        state: WorldState | None = None,
        *,
        also: Collection[str] = (),
        linear: bool = False,
        next_state: WorldState | None = None,
        previous_state: WorldState | None = None,
        frame_number: int = 0,
    ) -> Frame:
        """Render one frame of a state, or of the data's current one.

        Further arguments are those of `omnisim.Renderer.render`.

        Raises:
            OmnisimError: as `omnisim.Renderer.render`.
        """
        if state is None:
            state = self.state()
            self._deform()
        return self._renderer.render(
            state,
            linear,
            also=also,
            next_state=next_state,
            previous_state=previous_state,
            frame_number=frame_number,
        )

    @property
    def geoms(self) -> dict[str, int]:
        """Geom ID of each instance, by the instance's name (`body/geom`)."""
        return dict(self._moving.geom_of_instance)

    def geom_ids(self, frame: Frame) -> NDArray[np.int32]:
        """Geom IDs (height, width) of a frame's pixels; −1 where no geom is visible.

        Raises:
            OmnisimError: the frame was rendered without the channel instance.
        """
        if "instance" not in frame.channels or frame.labels is None:
            raise OmnisimError("geom_ids: expected a frame with also=('instance',), got without")
        if frame.labels is not self._labels:
            names = (instance.name for instance in frame.labels.instances)
            ids = [self._moving.geom_of_instance.get(name, NO_GEOM) for name in names]
            self._labels, self._geoms = frame.labels, np.array([NO_GEOM, *ids], dtype=np.int32)
        return self._geoms[frame.channels["instance"]]

    def _deform(self) -> None:
        """Update the shapes of skins and flexible bodies."""
        if self._model.nskin or self._model.nflex:
            from omnisim.scene.formats.mjcf.reader import deformed

            self._stage.scene = deformed(self._stage.scene, self._model, self._data, self._groups)

    def close(self) -> None:
        """Free the GPU memory; a second call does nothing."""
        self._renderer.close()
        self._stage.close()
