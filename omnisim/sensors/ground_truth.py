"""The channels of one camera: what its pixels' rays hit, in words that people use."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from omnisim.gpu.capture.capture_pass import Emit
from omnisim.gpu.capture.ray_table import RayTable
from omnisim.gpu.ground_truth.occlusion_pass import OcclusionPass
from omnisim.gpu.ground_truth.ray_hit_pass import RayHitPass, Surfaces
from omnisim.gpu.ground_truth.visibility_pass import VisibilityPass
from omnisim.scene.labels import find_labels
from omnisim.sensors.capturing import capture_of, faces_of
from omnisim.sensors.omnicamera import OmniCamera
from omnisim.sensors.optical_flow import FINENESS, OpticalFlow, View
from omnisim.sensors.stage import Stage


class GroundTruth:
    """Channels of one camera on a stage; everything on the GPU is made once.

    Args:
        stage: its context is current, here and in `channels`.
        sensor: the camera.
        hidden: names of the body's instances that it does not see.
        albedo: whether plain colours will be asked for.

    Attributes:
        labels: what the numbers of classes and instances mean.
        has_albedo: whether plain colours can be had.
    """

    def __init__(
        self, stage: Stage, sensor: OmniCamera, hidden: Collection[str], albedo: bool = False
    ):
        self._stage, self._sensor = stage, sensor
        self.has_albedo = albedo
        self.labels = find_labels(stage.scene, stage.moving)
        context, buffers, camera = stage.context, stage.buffers, sensor.model
        capture = capture_of(stage, sensor, camera, Emit.RAY)
        self._rays = RayTable(context, (camera.width_px, camera.height_px), capture)
        self._visibility = VisibilityPass(
            context,
            buffers,
            faces_of(sensor, camera, FINENESS),
            sensor.near_m,
            sensor.far_m,
            hidden,
            albedo,
        )
        self._surfaces = RayHitPass(context, self._visibility, self._rays, camera.rig_from_optical)
        self._flow: OpticalFlow | None = None
        object_names = [None, *stage.moving]
        ids = {(label.object_name, label.name): label.id for label in self.labels.instances}
        # from the draw −1, which is nothing, on
        self._instance_of_draw = np.array(
            [0]
            + [
                ids[
                    object_names[0 if draw.object_index is None else draw.object_index + 1],
                    draw.name,
                ]
                for draw in stage.buffers.draw_items
            ],
            dtype=np.uint32,
        )
        self._class_of_draw = self.labels.class_of_instance[self._instance_of_draw]

    def channels(
        self, names: Sequence[str], now: View, after: View | None = None
    ) -> dict[str, NDArray[Any]]:
        """The channels of these names, in their order.

        Args:
            names: as `check_channels` gives them; albedo only where `has_albedo`.
            now: where the camera and the dynamic objects are.
            after: where they are next, for the flow.
        """
        surfaces = self._surfaces.render(
            now.world_from_rig,
            now.world_from_objects,
            normals="normals" in names or "normals_camera" in names,
            albedos="albedo" in names,
        )
        world_from_optical = now.world_from_rig[:3, :3] @ self._sensor.model.rig_from_optical
        make = {
            "range": lambda: surfaces.ranges_m,
            "z": lambda: _along(surfaces, world_from_optical[:, 2]),
            "position": lambda: _positions(surfaces, now.world_from_rig[:3, 3]),
            "normals": lambda: surfaces.normals,
            "normals_camera": lambda: surfaces.normals @ world_from_optical.astype(np.float32),
            "albedo": lambda: surfaces.albedos,
            "semantic": lambda: self._class_of_draw.take(surfaces.draws_plus_one),
            "instance": lambda: self._instance_of_draw.take(surfaces.draws_plus_one),
            "valid": lambda: self._rays.valid.astype(np.uint8),
        }
        leads_on = after is not None and "flow" in names
        if leads_on:
            if self._flow is None:
                self._flow = self._make_flow()
            self._flow.start(now, after)
        # the GPU looks at the next view meanwhile
        found = {name: np.ascontiguousarray(make[name]()) for name in names if name in make}
        if leads_on:
            found["flow"], found["occluded"] = self._flow.finish(surfaces)
        return {name: found[name] for name in names if name in found}

    def _make_flow(self) -> OpticalFlow:
        next_view = OcclusionPass(self._stage.context, self._visibility, self._rays, self._surfaces)
        sensor = self._sensor
        is_mesh = sensor.polygons is not None
        return OpticalFlow(self._stage.buffers, sensor.model, self._rays, is_mesh, next_view)


def _along(surfaces: Surfaces, axis: NDArray[np.float64]) -> NDArray[np.float32]:
    """Coordinates (height, width) of the points along an axis (3,) of the world; +inf: none."""
    along = surfaces.points_m @ axis.astype(np.float32)
    return np.where(surfaces.draws_plus_one == 0, np.float32(np.inf), along)


def _positions(surfaces: Surfaces, viewpoint_m: NDArray[np.float64]) -> NDArray[np.float64]:
    """Points (height, width, 3) in the world; NaN: none."""
    points_m = np.empty(surfaces.points_m.shape)
    for axis in range(3):  # one after the other, which does not copy the points first
        np.add(surfaces.points_m[..., axis], viewpoint_m[axis], out=points_m[..., axis])
    points_m.reshape(-1, 3)[np.flatnonzero(surfaces.draws_plus_one == 0)] = np.nan
    return points_m
