"""Ground truth of a camera's image: channels, and motion of points, from the hits of its rays."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from omnisim.cameras import (
    CentralCamera,
    NonCentralCamera,
    Pixels,
    period_px,
    pixel_grid,
    pixels_of_points,
)
from omnisim.core.arrays import Bools, Bytes, Floats, Floats32, Indices, Uints32
from omnisim.core.world import ObjectPart, time_of
from omnisim.ground_truth.channels import CHANNELS, FLOWS, THROUGH
from omnisim.ground_truth.hits import HitDetails, Hits, ThroughHits
from omnisim.ground_truth.label_names import Labels
from omnisim.rendering.contract import CameraBackend, DeformingDraw, HitSource, ScenePoses


def ground_truth_of(camera: CameraBackend, names: Collection[str]) -> GroundTruth:
    """Ground truth of a camera that includes these channels, made on first use."""
    source = camera.hit_source(HitDetails.of_channels(names))
    if camera.truth is None or camera.truth[0] is not source:
        made = GroundTruth(source, camera.find_labels(), list(camera.world.objects))
        camera.truth = source, made
    truth = camera.truth[1]
    assert isinstance(truth, GroundTruth)
    return truth


class GroundTruth:
    """Channels of one camera; constant data is computed once."""

    def __init__(self, source: HitSource, labels: Labels, object_names: Sequence[str]):
        self._source, self._object_names = source, object_names
        self._number_draws(labels)

    def refresh(self, labels: Labels) -> None:
        """Update labels and draw items from the source."""
        self._number_draws(labels)
        if "_flow" in self.__dict__:
            self._flow.refresh()

    def _number_draws(self, labels: Labels) -> None:
        self.labels = labels
        self._instance_of_draw = instances_of_draws(labels, self._source.draws, self._object_names)
        self._objects_of_draws = self._source.objects_of_draws()
        self._class_of_draw = labels.class_of_instance[self._instance_of_draw]

    def channels(
        self,
        names: Sequence[str],
        current: ScenePoses,
        others: Mapping[str, ScenePoses] | None = None,
    ) -> dict[str, NDArray[Any]]:
        """Render the given channels, in their order.

        Args:
            names: channel names from `check_channels`, whose details the source provides.
            others: poses of the "next" and the "previous" image, for names whose `Channel.other`
                needs them.
        """
        hits = self._source.hits(current, HitDetails.of_channels(names))
        return self._channels_of(hits, names, current, others or {})

    def channels_through(
        self, names: Sequence[str], current: ScenePoses
    ) -> tuple[dict[str, NDArray[Any]], ThroughHits]:
        """Channels without flow, and the surfaces behind glass and after mirrors."""
        hits = self._source.hits(current, HitDetails.of_channels(names))
        channels = self._channels_of(hits, names, current, {})
        return channels, self._source.through(current, hits)

    def batch(
        self,
        names: Sequence[str],
        current: Sequence[ScenePoses],
        others: Mapping[str, Sequence[ScenePoses]],
    ) -> Iterator[dict[str, NDArray[Any]]]:
        """Render the channels of several images, in order; see `channels`."""
        flows = any(name in FLOWS for name in names)  # occlusion refers to the latest hits
        details = HitDetails.of_channels(names)
        hits = (
            (self._source.hits(poses, details) for poses in current)
            if flows
            else self._source.batch_hits(current, details)
        )
        for number, (poses, image_hits) in enumerate(zip(current, hits, strict=True)):
            other_poses = {other: some[number] for other, some in others.items()}
            yield self._channels_of(image_hits, names, poses, other_poses)

    def _channels_of(
        self, hits: Hits, names: Sequence[str], current: ScenePoses, poses: Mapping[str, ScenePoses]
    ) -> dict[str, NDArray[Any]]:
        """Channels of an image from its hits."""
        rig_from_optical = self._source.camera.rig_from_optical
        world_from_optical = current.world_from_rig[:3, :3] @ rig_from_optical
        make: dict[str, Callable[[], NDArray[Any]]] = {
            "range": lambda: hits.ranges_m,
            "z": lambda: np.where(
                hits.draw_ids == 0,
                np.float32(np.inf),
                hits.points_m @ world_from_optical[:, 2].astype(np.float32),
            ),
            "position": lambda: _positions_m(hits, current.world_from_rig[:3, 3]),
            "normals": lambda: hits.normals,
            "normals_camera": lambda: hits.normals @ world_from_optical.astype(np.float32),
            "albedo": lambda: hits.albedos,
            "roughness": lambda: hits.roughness,
            "metallic": lambda: hits.metallic,
            "emissive": lambda: hits.emissive,
            "semantic": lambda: self._class_of_draw.take(hits.draw_ids),
            "instance": lambda: self._instance_of_draw.take(hits.draw_ids),
            "scene_flow": lambda: self._scene_flow(
                hits, current, poses["next"], in_world(current, poses["next"]), np.eye(3)
            ),
            "scene_flow_camera": lambda: self._scene_flow(
                hits,
                current,
                poses["next"],
                in_optical(current, poses["next"], rig_from_optical),
                world_from_optical.T,
            ),
            "valid": lambda: self.has_ray.astype(np.uint8),
        }
        flows = [
            (pair, poses[CHANNELS[pair[0]].other]) for pair in FLOWS.items() if pair[0] in names
        ]
        if not THROUGH.isdisjoint(names):
            through = self._source.through(current, hits)
            make["range_through"] = lambda: through.ranges_m
            make["semantic_through"] = lambda: self._class_of_draw.take(through.draw_ids)
        motion = self._flow.begin(hits, current, flows[0][1]) if flows else None
        # the GPU renders the occlusion meanwhile
        channels = {name: np.ascontiguousarray(make[name]()) for name in names if name in make}
        for pair, other in flows:
            if motion is None:
                motion = self._flow.begin(hits, current, other)
            channels |= zip(pair, self._flow.end(hits, motion), strict=True)
            motion = None
        return {name: channels[name] for name in names}

    def _scene_flow(
        self,
        hits: Hits,
        current: ScenePoses,
        other: ScenePoses,
        transforms: Floats,
        axes_from_viewpoint: Floats,
    ) -> Floats32:
        """Scene flow along axes, by transforms (objects, 3, 4) from points to their motions."""
        deformed = deformed_hits(self._source, hits, current, other)
        if deformed is None:
            return scene_flow(hits, self._objects_of_draws, transforms)
        flow = scene_flow(deformed, self._objects_of_draws, transforms)
        return flow + (deformed.points_m - hits.points_m) @ axes_from_viewpoint.T.astype(np.float32)

    @property
    def has_ray(self) -> Bools:
        """Mask (height, width) of pixels whose center has a ray."""
        return self._source.has_ray

    @cached_property
    def _flow(self) -> OpticalFlow:
        return OpticalFlow(self._source)


def instances_of_draws(
    labels: Labels, draws: Sequence[ObjectPart], object_names: Sequence[str]
) -> Uints32:
    """Instance IDs (n + 1,) of draws (n,), starting with draw −1, no draw: 0."""
    ids = {(label.object_name, label.name): label.id for label in labels.instances}
    instances = [
        # a draw item that is no longer drawn has no ID
        ids.get((None if index is None else object_names[index], name), 0)
        for index, name in draws
    ]
    return np.array([0, *instances], dtype=np.uint32)


def _positions_m(hits: Hits, viewpoint_m: Floats) -> Floats:
    """Points (height, width, 3) in the world; NaN: no hit."""
    points_m = np.empty(hits.points_m.shape)
    for axis in range(3):  # axis by axis, which avoids a copy of the points
        np.add(hits.points_m[..., axis], viewpoint_m[axis], out=points_m[..., axis])
    points_m.reshape(-1, 3)[np.flatnonzero(hits.draw_ids == 0)] = np.nan
    return points_m


# Motion of the points that pixels see: scene flow, and optical flow to another image.
#
# Points are those of the hits, in the viewpoint frame: world axes, with the origin in the
# effective viewpoint. Object 0 is the static scene, 1 the first dynamic object, and so on.
# Source: Vedula et al., "Three-dimensional scene flow", 1999.


# Points per step: intermediate arrays stay in the cache, and BLAS stays on one thread. It runs
# larger products on threads that keep spinning and occupy cores afterwards.
POINTS_PER_BATCH = 1 << 14


def moved_from_current(current: ScenePoses, other: ScenePoses) -> Floats:
    """Motions (objects, 4, 4) of the objects from one time to another, in the viewpoint frame."""
    viewpoint_m = current.world_from_rig[:3, 3]
    transforms = np.tile(np.eye(4), (1 + len(current.world_from_objects), 1, 1))
    pairs = zip(current.world_from_objects, other.world_from_objects, strict=True)
    for transform, (before, then) in zip(transforms[1:], pairs, strict=True):
        moved = then @ np.linalg.inv(before)
        transform[:3, :3] = moved[:3, :3]
        # a point at the current viewpoint, minus that viewpoint
        transform[:3, 3] = moved[:3, :3] @ viewpoint_m + (moved[:3, 3] - viewpoint_m)
    return transforms


def other_from_current(current: ScenePoses, other: ScenePoses) -> Floats:
    """Transforms (objects, 3, 4) of each object's points to the viewpoint frame of another time."""
    transforms = moved_from_current(current, other)
    transforms[:, :3, 3] += current.world_from_rig[:3, 3] - other.world_from_rig[:3, 3]
    return transforms


def transform_points(points: Floats, objects: Indices | None, transforms: Floats) -> Floats:
    """Points (n, 4), last 0 for directions, by matrices (objects, 3, 4) of objects (n,)."""
    moved: Floats = points @ transforms[0].T
    if objects is not None:
        for index in np.unique(objects):
            on_it = np.flatnonzero(objects == index)
            moved[on_it] = points[on_it] @ transforms[index].T
    return moved


def scene_flow(hits: Hits, objects_of_draws: Indices, transforms: Floats) -> Floats32:
    """Scene flow (height, width, 3) in meters; NaN: no hit.

    Args:
        objects_of_draws: (n + 1,), see `HitSource.objects_of_draws`.
        transforms: (objects, 3, 4) from a point to its motion, see `in_world` and `in_optical`.
    """
    points = hits.points_and_ranges_m.reshape(-1, 4)
    # float32 like the points; without a hit the range is infinite and makes the motion NaN
    matrices = np.zeros((len(transforms), 4, 3), dtype=np.float32)
    matrices[:, :3] = np.swapaxes(transforms[:, :, :3], 1, 2)
    offsets = transforms[:, :, 3].astype(np.float32)
    flow = np.empty((len(points), 3), dtype=np.float32)
    draw_ids = hits.draw_ids.ravel()
    with np.errstate(invalid="ignore"):
        for first in range(0, len(points), POINTS_PER_BATCH):
            batch = slice(first, first + POINTS_PER_BATCH)
            flow[batch] = points[batch] @ matrices[0] + offsets[0]
            if len(transforms) == 1:
                continue
            objects = objects_of_draws.take(draw_ids[batch])
            for index in np.unique(objects[objects > 0]).tolist():
                on_it = np.flatnonzero(objects == index)
                flow[first + on_it] = points[batch][on_it] @ matrices[index] + offsets[index]
    return flow.reshape(hits.points_m.shape)


def in_world(current: ScenePoses, other: ScenePoses) -> Floats:
    """Transforms (objects, 3, 4) from points to motions along the world's axes; 0: static."""
    return moved_from_current(current, other)[:, :3] - np.eye(4)[:3]


def in_optical(current: ScenePoses, other: ScenePoses, rig_from_optical: Floats) -> Floats:
    """Transforms (objects, 3, 4) from points to their motions relative to the camera.

    A motion is the point in the other time's optical frame minus the point in the current one.
    """
    transforms = other_from_current(current, other)[:, :3]
    transforms = (other.world_from_rig[:3, :3] @ rig_from_optical).T @ transforms
    transforms[:, :, :3] -= (current.world_from_rig[:3, :3] @ rig_from_optical).T
    return transforms


# Points of deforming surfaces at another time, by their position in the triangle hit.
_MIN_AREA = 1e-300  # squared area below which a triangle is degenerate


def deformed_hits(
    source: HitSource, hits: Hits, current: ScenePoses, other: ScenePoses
) -> Hits | None:
    """Hits with points deformed as at another time, with objects and camera at the current poses.

    Rigid motion is applied separately. Ranges keep their current values.

    Returns:
        Deformed hits; None: nothing deforms.
    """
    times_s = time_of(current.world_from_objects), time_of(other.world_from_objects)
    if not source.deforming or times_s[0] == times_s[1]:
        return None
    points = hits.points_and_ranges_m.copy()
    flat, draw_ids = points.reshape(-1, 4), hits.draw_ids.ravel()
    for draw, deforming in source.deforming.items():
        seen = np.flatnonzero(draw_ids == draw + 1)
        if len(seen):
            triangles = hits.triangles.ravel()[seen]
            viewpoint_from_mesh = deforming.object_from_mesh.copy()
            if deforming.object_index is not None:
                pose = current.world_from_objects[deforming.object_index]
                viewpoint_from_mesh = pose @ viewpoint_from_mesh
            viewpoint_from_mesh[:3, 3] -= current.world_from_rig[:3, 3]
            flat[seen, :3] = _deformed(
                flat[seen, :3].astype(np.float64),
                deforming,
                triangles,
                viewpoint_from_mesh,
                times_s,
            )
    return hits._replace(points_and_ranges_m=points)


def _deformed(
    points_m: Floats,
    draw: DeformingDraw,
    triangles: Uints32,
    viewpoint_from_mesh: Floats,
    times_s: tuple[float, float],
) -> Floats:
    """Points (n, 3) on triangles (n,) of a mesh, moved from its shape at one time to another."""
    deformation = draw.mesh.deformation
    assert deformation is not None
    hit = draw.mesh.triangles[triangles].astype(np.intp)
    used, corners = np.unique(hit, return_inverse=True)
    before, after = (
        (
            deformation.positions_at(time_s, used) @ viewpoint_from_mesh[:3, :3].T
            + viewpoint_from_mesh[:3, 3]
        )[corners.reshape(-1, 3)]
        for time_s in times_s
    )
    first, second = before[:, 1] - before[:, 0], before[:, 2] - before[:, 0]
    across = np.cross(first, second)
    squared = np.maximum(np.einsum("nc,nc->n", across, across), _MIN_AREA)
    inside = points_m - before[:, 0]
    of_second = np.einsum("nc,nc->n", np.cross(inside, second), across) / squared
    of_third = np.einsum("nc,nc->n", np.cross(first, inside), across) / squared
    return (
        after[:, 0]
        + of_second[:, None] * (after[:, 1] - after[:, 0])
        + of_third[:, None] * (after[:, 2] - after[:, 0])
    )


# Optical flow from a camera's image to another one, by exact reprojection, and occlusion.
#
# The other image is the next one; for backward flow, the previous one.
VISIBLE, OCCLUDED, OUTSIDE, INVALID = 0, 1, 2, 255


class OpticalFlow:
    """Optical flow of one camera; constant data is computed once.

    The point seen by a pixel moves with its surface, also on dynamic objects and deforming meshes.
    It is projected from the other viewpoint in float64. Without a hit the point is infinitely far:
    only the camera's rotation moves it.

    The point is occluded if the ray from the other viewpoint to it hits something nearer. An
    optical system projects it by its exact inverse; that ray starts at the system's ray origin.

    Flow through a mirror mesh follows the exact model, from the pixel where the exact camera sees
    the point to the pixel where it sees it at the other time. The error of the mesh is nearly the
    same in both images, and is not motion.

    In an image that covers all directions, flow across the seam takes the short way and leaves the
    image by that distance.
    """

    def __init__(self, source: HitSource):
        self._camera, self._source = source.camera, source
        self._shape = source.has_ray.shape
        self._valid = np.flatnonzero(source.has_ray)
        # pixels where the exact camera sees the points: the pixels themselves, except with a mesh
        self._by_points = source.polygons is not None and isinstance(self._camera, NonCentralCamera)
        self._positions_px = (
            pixel_grid(*self._shape[::-1])[source.has_ray]
            if source.polygons is None or self._by_points
            else self._camera.pixel_from_ray(source.rays()[source.has_ray]).positions_px
        )
        self.refresh()
        self._period_px = period_px(self._camera)

    def refresh(self) -> None:
        """Update the draw items from the source."""
        self._object_of_draw = self._source.objects_of_draws()

    def begin(self, hits: Hits, current: ScenePoses, other: ScenePoses) -> Floats:
        """Start to render the occlusion of the latest hits; return the argument of `end`.

        Returns:
            (1 + objects, 3, 4), from the current viewpoint frame to the other optical frame: for
            static points, and for points on each dynamic object.
        """
        transforms = other_from_current(current, other)
        self._deformed = deformed_hits(self._source, hits, current, other)
        moves = transforms[self._object_of_draw[1:], :3]
        self._occluded = self._source.begin_occlusion(other, moves, self._deformed)
        self._optical_from_current = _optical_from_world(current, self._camera)
        return _optical_from_world(other, self._camera) @ transforms[:, :3]

    def end(self, hits: Hits, other_optical_from_current: Floats) -> tuple[Floats32, Bytes]:
        """Compute the flow.

        Args:
            other_optical_from_current: result of `begin`.

        Returns:
            Flow (height, width, 2) in pixels, NaN where the lens cannot see the point at the other
            time; and (height, width) of `VISIBLE`, `OCCLUDED`, `OUTSIDE`, `INVALID`: the pixel has
            no ray.
        """
        projected = self._pixels_of(self._deformed or hits, other_optical_from_current)
        positions_px = self._positions_px
        if self._by_points:
            still = np.zeros_like(other_optical_from_current)
            still[:, :, :3] = self._optical_from_current
            positions_px = self._pixels_of(hits, still).positions_px
        motion_px = projected.positions_px - positions_px
        if self._period_px is not None:
            motion_px[:, 0] -= self._period_px * np.round(motion_px[:, 0] / self._period_px)
        motion_px[np.flatnonzero(~projected.valid)] = np.nan
        flow = np.full((self._shape[0] * self._shape[1], 2), np.nan, dtype=np.float32)
        # both components of a pixel at once
        flow.view(np.uint64)[self._valid] = motion_px.astype(np.float32).view(np.uint64)
        status = np.full(len(flow), INVALID, dtype=np.uint8)
        occluded = self._occluded.result().ravel()[self._valid]
        u, v = projected.positions_px.T
        is_inside = projected.valid & (u >= -0.5) & (u < self._camera.width_px - 0.5)
        is_inside &= (v >= -0.5) & (v < self._camera.height_px - 0.5)
        status[self._valid] = np.where(is_inside, occluded * np.uint8(OCCLUDED), np.uint8(OUTSIDE))
        return flow.reshape(*self._shape, 2), status.reshape(self._shape)

    def _pixels_of(self, hits: Hits, optical_from_current: Floats) -> Pixels:
        """Project the points (n,) of the valid pixels into an image."""
        points_m = np.take(hits.points_and_ranges_m.reshape(-1, 4), self._valid, axis=0).astype(
            np.float64
        )
        draw_ids = hits.draw_ids.ravel()[self._valid]
        points_m[:, 3] = draw_ids > 0  # 0: a direction, unaffected by translation
        has_objects = len(optical_from_current) > 1
        objects = self._object_of_draw[draw_ids] if has_objects else None
        positions_px, valid = np.empty((len(points_m), 2)), np.empty(len(points_m), dtype=np.bool_)
        for first in range(0, len(points_m), POINTS_PER_BATCH):
            batch = slice(first, first + POINTS_PER_BATCH)
            optical_m = transform_points(
                points_m[batch], None if objects is None else objects[batch], optical_from_current
            )
            positions_px[batch], valid[batch] = pixels_of_points(
                self._camera, optical_m, points_m[batch, 3] > 0.0
            )
        return Pixels(positions_px, valid)


def _optical_from_world(poses: ScenePoses, camera: CentralCamera) -> Floats:
    """Rotation (3, 3) from the world to the optical frame of a camera."""
    return (poses.world_from_rig[:3, :3] @ camera.rig_from_optical).T
