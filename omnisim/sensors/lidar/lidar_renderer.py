"""A spinning lidar in a scene: the world's motion in, point clouds out."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from omnisim.core.poses import check_pose
from omnisim.core.version import __version__
from omnisim.core.world import Motion, ObjectPart, WorldState
from omnisim.ground_truth.lidar_beams import LidarPoses
from omnisim.rendering.backend import BeamCaster, LabelCache
from omnisim.rendering.stage import BackendName, SensorRenderer, Stage
from omnisim.rendering.truth.ground_truth import instances_of_draws
from omnisim.rendering.truth.moving_boxes import MovingBoxes
from omnisim.scene import Scene
from omnisim.sensors.lidar.point_cloud import PointCloud, make_points
from omnisim.sensors.lidar.revolution import plan_revolution
from omnisim.sensors.lidar.spinning_lidar import SpinningLidar


class LidarRenderer(SensorRenderer[BeamCaster]):
    """Takes a lidar's point clouds of a scene; loads and compiles everything once.

    Use it as a context manager, or `close` it: it holds memory of the GPU.

    Args:
        scene: to scan, or its path or built-in name; or a stage of it that other sensors share.
        lidar: by default a VLP-16.
        body: of the vehicle, in its base frame; a stage has its own.
        base_from_lidar: (4, 4) its mount on the vehicle; by default at the base.
        hidden: names of the body's instances that beams go through: the lidar's own housing.
        device: EGL's number of the GPU, as `omnisim info` lists them; None takes the first. A
            stage has chosen already.
        vehicle: name of the vehicle that carries the lidar, of a stage with several.
        backend: finds the hits; a stage has chosen already.

    Raises:
        GraphicsError: see `SensorRenderer`; or more beams than fit on the GPU.
        OmnisimError: a mount that is not a pose.
    """

    def __init__(
        self,
        scene: Scene | Stage | str | Path,
        lidar: SpinningLidar | None = None,
        *,
        base_from_lidar: ArrayLike | None = None,
        body: Scene | None = None,
        hidden: Collection[str] = (),
        device: int | None = None,
        vehicle: str | None = None,
        backend: BackendName | None = None,
    ):
        self.lidar = SpinningLidar() if lidar is None else lidar
        self._base_from_lidar = check_pose(
            np.eye(4) if base_from_lidar is None else base_from_lidar
        )

        def make_passes(stage: Stage, parts: frozenset[ObjectPart]) -> BeamCaster:
            return stage.backend.beam_caster(self.lidar.beams, parts)

        super().__init__(scene, body, hidden, device, make_passes, vehicle, backend)
        self._labels = LabelCache()
        self._boxes = MovingBoxes(self.scene, self._stage.objects.values())

    def _sensor_summary(self) -> str:
        return f"{self.lidar.rings} rings × {self.lidar.firings} firings"

    def scan(
        self, motion: Motion | WorldState | ArrayLike, time_s: float = 0.0, revolution: int = 0
    ) -> PointCloud:
        """Take the point cloud of the revolution that ends at a time.

        Args:
            motion: states of the world by seconds, or (4, 4) poses of the vehicle where nothing
                else moves; or one of either, at rest.
            time_s: of the end.
            revolution: its number in the drive; the noise depends on it and on the lidar's seed
                alone.

        Raises:
            OmnisimError: a matrix that is not a pose, an object without one, a number that is none,
                a vehicle that turns too fast, or the renderer or its stage is closed.
        """

        def poses_at(at_s: float) -> LidarPoses:
            state = self._state(motion(at_s) if callable(motion) else motion)
            world_from_lidar = state.world_from_object[self.vehicle] @ self._base_from_lidar
            return LidarPoses(world_from_lidar, self._stage.poses_in(state))

        lidar, stage = self.lidar, self._stage
        start_s = time_s - lidar.period_s
        with self._current() as caster:
            plan = plan_revolution(lidar, poses_at, start_s, self._boxes)
            hits = caster.cast(plan)
            draws = caster.draws
        labels = self._labels.find(stage.scene, stage.objects, tuple(stage.vehicles))
        instances = instances_of_draws(labels, draws, list(stage.objects))
        ranges_m = lidar.measure(hits.ranges_m, revolution)
        metadata = {
            "omnisim": __version__,
            "scene": stage.scene.name,
            **self._body_metadata(),
            "revolution": int(revolution),
            "time_s": float(time_s),
        }
        return PointCloud(
            make_points(lidar, ranges_m, instances.take(hits.draws_plus_one)),
            lidar,
            plan.slices[0].start.world_from_lidar,
            plan.slices[-1].end.world_from_lidar,
            metadata,
        )
