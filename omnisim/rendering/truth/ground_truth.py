"""Ground-truth channels of one camera, from the hits of its pixels' rays."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from omnisim.core.arrays import Bools, Floats, Floats32, Uints32
from omnisim.core.world import ObjectPart
from omnisim.ground_truth.channels import CHANNELS, FLOWS, THROUGH
from omnisim.ground_truth.hits import HitDetails, Hits, ThroughHits
from omnisim.ground_truth.label_names import Labels
from omnisim.rendering.contract import CameraBackend, HitSource, ScenePoses
from omnisim.rendering.truth.flow import (
    OpticalFlow,
    deformed_hits,
    in_optical,
    in_world,
    scene_flow,
)


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
            (self._source.hits(one, details) for one in current)
            if flows
            else self._source.batch_hits(current, details)
        )
        for number, (one, image_hits) in enumerate(zip(current, hits, strict=True)):
            other_poses = {other: some[number] for other, some in others.items()}
            yield self._channels_of(image_hits, names, one, other_poses)

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
