"""A depth camera in a scene: states of the world in, depths out."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from omnisim.core.poses import check_pose, pose
from omnisim.core.world import ObjectPart, WorldState
from omnisim.rendering.backend import CameraBackend, CameraSetup
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.near_plane import scene_size_m
from omnisim.rendering.readback import ScenePoses
from omnisim.rendering.stage import BackendName, SensorRenderer, Stage
from omnisim.scene import Scene
from omnisim.sensors.depth_camera.depth_camera import DepthCamera


class _View:
    """True depths of one view of a depth camera."""

    def __init__(self, backend: CameraBackend):
        self._backend = backend

    @property
    def sensor(self) -> OmniCamera:
        """Camera of the view."""
        return self._backend.setup.sensor

    def refresh(self) -> None:
        """Work on what the stage has now."""
        self._backend.refresh()

    def channels(
        self,
        names: Sequence[str],
        world_from_base: NDArray[np.float64],
        stage_poses: tuple[NDArray[np.float64], ...],
    ) -> dict[str, NDArray[np.float32]]:
        """Channels of ground truth at poses of the vehicle and of all objects."""
        poses = ScenePoses(world_from_base @ self.sensor.base_from_rig, stage_poses)
        return self._backend.ground_truth(names).channels(names, poses)


class _Views:
    """Views of the camera and of what is beside it."""

    def __init__(self, first: _View, second: _View):
        self.first, self.second = first, second

    def refresh(self) -> None:
        """Work on what the stage has now."""
        self.first.refresh()
        self.second.refresh()


class DepthRenderer(SensorRenderer[_Views]):
    """Takes a depth camera's images of a scene; loads and compiles everything once.

    Use it as a context manager, or `close` it: it holds memory of the GPU.

    Args:
        scene: to see, or its path or built-in name; or a stage of it that other sensors share.
        camera: by default a Kinect of the first version.
        base_from_camera: (4, 4) its mount on the vehicle, looking along x; by default at the base.
        body: of the vehicle, in its base frame; a stage has its own.
        hidden: names of the body's instances that are not seen, such as the camera's housing.
        device: EGL's number of the GPU, as `omnisim info` lists them; None takes the first. A
            stage has chosen already.
        seed: of the camera's noise.
        vehicle: name of the vehicle that carries the camera, of a stage with several.
        backend: "cube" finds depths by OpenGL, "rays" by Embree. A stage has chosen already.

    Raises:
        GraphicsError: no OpenGL, too old an OpenGL, or sizes past its limits.
        SceneError: a hidden name that the body does not have.
    """

    def __init__(
        self,
        scene: Scene | Stage | str | Path,
        camera: DepthCamera | None = None,
        *,
        base_from_camera: ArrayLike | None = None,
        body: Scene | None = None,
        hidden: Collection[str] = (),
        device: int | None = None,
        seed: int | str = 0,
        vehicle: str | None = None,
        backend: BackendName | None = None,
    ):
        self.camera = DepthCamera() if camera is None else camera
        self._seed = seed
        mount = check_pose(np.eye(4) if base_from_camera is None else base_from_camera)
        # to the right, as seen along x
        beside = mount @ pose((0.0, -self.camera.baseline_m, 0.0))
        sensors = (
            OmniCamera(self.camera.model, base_from_rig=mount),
            OmniCamera(self.camera.second_model, base_from_rig=beside),
        )

        def make_passes(stage: Stage, parts: frozenset[ObjectPart]) -> _Views:
            size_m, vehicles = scene_size_m(stage.scene), tuple(stage.vehicles)
            seeing = (one.seeing(size_m) for one in sensors)
            setups = (CameraSetup(one, True, parts, 0, vehicles) for one in seeing)
            return _Views(*(_View(stage.backend.camera(setup)) for setup in setups))

        super().__init__(scene, body, hidden, device, make_passes, vehicle, backend)

    def _sensor_summary(self) -> str:
        return f"{self.camera.width_px} × {self.camera.height_px} px"

    def measure(self, state: WorldState | ArrayLike, frame_number: int = 0) -> NDArray[np.float32]:
        """Depths (height, width) along the optical axis in meters, 0 in holes.

        Args:
            state: of the world; or, where nothing else moves, the (4, 4) pose of the vehicle.
            frame_number: noise differs from frame to frame.

        Raises:
            OmnisimError: a matrix that is not a pose, an object without one, or the renderer or its
                stage is closed.
        """
        now = self._state(state)
        world_from_base = now.world_from_object[self.vehicle]
        stage_poses = self._stage.poses_in(now)
        with self._current() as views:
            names = ("z", "normals_camera")
            first = views.first.channels(names, world_from_base, stage_poses)
            second_z_m = views.second.channels(("z",), world_from_base, stage_poses)["z"]
        return self.camera.measure(
            first["z"],
            second_z_m,
            self._incidence_cosines(first["normals_camera"]),
            self._seed,
            frame_number,
        )

    def _incidence_cosines(self, normals: NDArray[np.float32]) -> NDArray[np.float32]:
        """Cosines (height, width) of normals (height, width, 3), optical frame, with rays."""
        model = self.camera.model
        u, v = np.meshgrid(np.arange(model.width_px), np.arange(model.height_px))
        rays = model.ray_from_pixel(np.stack((u, v), axis=-1)).directions.astype(np.float32)
        cosines: NDArray[np.float32] = np.abs(np.einsum("hwc,hwc->hw", normals, rays))
        return cosines
