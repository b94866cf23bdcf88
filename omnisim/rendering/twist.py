"""Motion of camera and dynamic objects during an exposure, and how far it moves the image."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np
from pydantic import Field

from omnisim.cameras import CentralCamera, pixels_of_points
from omnisim.core.arrays import Floats
from omnisim.core.files.parameters import Number, Parameters
from omnisim.core.poses import pose_from_rotation
from omnisim.core.world import Pose, time_of
from omnisim.rendering.contract import ScenePoses
from omnisim.scene import Scene
from omnisim.scene.model import Instance
from omnisim.scene.motion.deformation import Deformation

# Assumed distance of the nearest surface, because depth is unknown before rendering. Nearer
# surfaces move farther between sub-frames.
ASSUMED_DISTANCE_M = 1.0
# Limits of a camera's motion; within them poses are exact to 1e-9 even for an exposure of an hour.
MAX_MPS, MAX_RADPS = 1e4, 1e3
GRID = 13  # samples of the motion per image side
SPREAD_RAD = 0.3  # from any direction in the image to the nearest sample of a wide lens

Speed = Annotated[Number, Field(ge=-MAX_MPS, le=MAX_MPS)]
TurnRate = Annotated[Number, Field(ge=-MAX_RADPS, le=MAX_RADPS)]


@dataclass(frozen=True)
class Twist(Parameters, name="twist"):
    """Constant velocity, linear and angular.

    Attributes:
        linear_mps: velocity of the base, in the base's own frame: x forward, y left, z up.
        angular_radps: turn rate about these axes; z counter-clockwise seen from above, to the left.

    Raises:
        OpticsError: a rate that is not finite, or beyond `MAX_MPS` or `MAX_RADPS`.
    """

    linear_mps: tuple[Speed, Speed, Speed] = (0.0, 0.0, 0.0)
    angular_radps: tuple[TurnRate, TurnRate, TurnRate] = (0.0, 0.0, 0.0)

    def through(self, world_from_base: Pose) -> Callable[[float], Pose]:
        """Poses (4, 4) of this motion by seconds, at a pose (4, 4) at 0 s."""
        x, y, z = self.angular_radps
        rates = np.array(
            [
                [0.0, -z, y, self.linear_mps[0]],
                [z, 0.0, -x, self.linear_mps[1]],
                [-y, x, 0.0, self.linear_mps[2]],
                [0.0, 0.0, 0.0, 0.0],
            ]
        )

        def at(time_s: float) -> Pose:
            from scipy.linalg import expm  # slow to import; instantaneous shutters never need it

            moved = expm(rates * time_s)
            moved[3] = (0.0, 0.0, 0.0, 1.0)  # inexact after a long way
            return world_from_base @ moved

        return at


def moved_px(
    camera: CentralCamera, poses: Sequence[ScenePoses], object_corners_m: Sequence[Floats] = ()
) -> float:
    """Largest motion in the image along poses of the camera and the dynamic objects, in pixels.

    Args:
        camera: camera model.
        poses: consecutive poses.
        object_corners_m: (8, 3) corners of each dynamic object's box, in its own frame.
    """
    u = np.linspace(0.0, camera.width_px - 1.0, GRID)
    v = np.linspace(0.0, camera.height_px - 1.0, GRID)
    pixels = np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 2)
    rays = camera.ray_from_pixel(pixels)
    pixels, points_m = pixels[rays.valid], ASSUMED_DISTANCE_M * rays.directions[rays.valid]
    if rays.origins_m is not None:
        points_m += rays.origins_m[rays.valid]
    is_finite = np.ones(len(points_m), dtype=np.bool_)
    world_from_optical = [pose.world_from_rig.copy() for pose in poses]
    for pose in world_from_optical:
        pose[:3, :3] = pose[:3, :3] @ camera.rig_from_optical
    static_px = np.zeros(len(points_m))
    for before, after in itertools.pairwise(world_from_optical):
        moved_m = _moved(points_m, np.linalg.inv(after) @ before)
        seen = pixels_of_points(camera, moved_m, is_finite)
        static_px += np.where(seen.valid, np.linalg.norm(seen.positions_px - pixels, axis=-1), 0.0)
    if rays.origins_m is not None and rays.valid.any():
        # distances count from the rays' origins, which may be on a mirror before the camera
        middle_m = rays.origins_m[rays.valid].mean(axis=0)
        world_from_optical = [
            pose @ pose_from_rotation(np.eye(3), middle_m) for pose in world_from_optical
        ]
    dynamic_px = [
        _object_px(camera, rays.directions[rays.valid], world_from_optical, path, corners_m)
        for corners_m, path in zip(
            object_corners_m,
            zip(*(pose.world_from_objects for pose in poses), strict=True),
            strict=True,
        )
    ]
    return float(max([static_px.max(initial=0.0), *dynamic_px]))


def _object_px(
    camera: CentralCamera,
    seen: Floats,
    world_from_optical: Sequence[Pose],
    world_from_object: Sequence[Pose],
    corners_m: Floats,
) -> float:
    """Largest motion of an object in the image, in pixels, from its nearest point on.

    Args:
        camera: camera model.
        seen: directions (n, 3) spread over the image, optical frame.
        world_from_optical: consecutive poses of the camera, with their origin at the center of its
            rays' origins.
        world_from_object: poses of the object.
        corners_m: (8, 3) corners of its box, in its own frame.
    """
    optical_from_object = [
        np.linalg.inv(optical) @ pose
        for optical, pose in zip(world_from_optical, world_from_object, strict=True)
    ]
    if not len(corners_m) or not _may_be_seen(seen, corners_m, optical_from_object):
        return 0.0
    places = [_moved(corners_m, pose) for pose in optical_from_object]
    ways_m = [np.linalg.norm(b - a, axis=-1).max() for a, b in itertools.pairwise(places)]
    low, high = corners_m.min(axis=0), corners_m.max(axis=0)
    nearest_m = min(
        float(np.linalg.norm(eye - np.clip(eye, low, high)))
        for eye in (np.linalg.inv(pose)[:3, 3] for pose in optical_from_object)
    )
    # inside the box, the distance of the surfaces is unknown
    return float(sum(ways_m)) / (nearest_m or ASSUMED_DISTANCE_M) * _px_per_rad(camera)


def _may_be_seen(seen: Floats, corners_m: Floats, optical_from_object: Sequence[Pose]) -> bool:
    """Tell whether the sphere around an object comes near any direction (n, 3) of the image."""
    middle_m = corners_m.mean(axis=0)
    radius_m = np.linalg.norm(corners_m - middle_m, axis=-1).max()
    for pose in optical_from_object:
        center_m = _moved(middle_m, pose)
        away_m = np.linalg.norm(center_m)
        if away_m <= radius_m:
            return True
        angles = np.arccos(np.clip(seen @ center_m / away_m, -1.0, 1.0))
        if angles.min(initial=np.pi) <= np.arcsin(radius_m / away_m) + SPREAD_RAD:
            return True
    return False


def _px_per_rad(camera: CentralCamera) -> float:
    """Pixels per radian, close to the maximum in the image."""
    u = np.linspace(0.0, camera.width_px - 2.0, GRID)
    v = np.linspace(0.0, camera.height_px - 2.0, GRID)
    pixels = np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 2)
    rays = camera.ray_from_pixel(pixels)
    densities = [0.0]
    for step in ((1.0, 0.0), (0.0, 1.0)):
        beside = camera.ray_from_pixel(pixels + step)
        both = rays.valid & beside.valid
        apart = np.linalg.norm(beside.directions[both] - rays.directions[both], axis=-1)
        # except at the poles of a panorama, where a pixel is no angle
        densities += [1.0 / np.percentile(apart, 10.0)] if len(apart) else []
    return float(max(densities))


def _moved(points_m: Floats, target_from_source: Floats) -> Floats:
    """Points (n, 3) in another frame."""
    return points_m @ target_from_source[:3, :3].T + target_from_source[:3, 3]


# Bounding boxes of moving parts: dynamic objects, and the vertices bound to each joint.
_MIN_VOLUME = 1e-12  # of a joint's transform: flatter ones are ignored


class _JointBox(NamedTuple):
    """Joint of a deforming mesh."""

    object_index: int | None  # index of the dynamic object with the mesh; None: static
    instance: Instance  # instance of the mesh
    deformation: Deformation  # deformation of the mesh
    joint: int  # index of the joint
    bind_from_object: Pose  # (4, 4) transform at 0 s


class MovingBoxes:
    """Bounding boxes in moving frames; `corners_m`: (8, 3) in each one's own, or (0, 3)."""

    def __init__(self, scene: Scene, objects: Iterable[Scene]):
        objects = list(objects)
        boxes = [np.array(list(itertools.product(*moving.bounds_m().T))) for moving in objects]
        self.corners_m = [box if np.isfinite(box).all() else box[:0] for box in boxes]
        self._joints: list[_JointBox] = []
        for index, part in enumerate((scene, *objects), start=-1):
            for instance in part.instances:
                deformation = part.meshes[instance.mesh].deformation
                if deformation is None:
                    continue
                matrices = instance.world_from_mesh @ deformation.matrices_at(0.0)
                for joint, corners in zip(*deformation.joint_boxes(), strict=True):
                    matrix = matrices[joint]
                    size = float(np.linalg.norm(matrix[:3, :3], 2))
                    if abs(np.linalg.det(matrix[:3, :3])) > _MIN_VOLUME * size**3:
                        of_object, inverse = index if index >= 0 else None, np.linalg.inv(matrix)
                        self._joints.append(
                            _JointBox(of_object, instance, deformation, int(joint), inverse)
                        )
                        self.corners_m.append(corners @ matrix[:3, :3].T + matrix[:3, 3])

    def poses(self, world_from_objects: Sequence[Pose]) -> list[Pose]:
        """Transforms (4, 4) of the boxes at the objects' poses and time; nearly rigid."""
        poses, time_s = list(world_from_objects), time_of(world_from_objects)
        for index, instance, deformation, joint, bind_from_object in self._joints:
            matrix = deformation.matrices_at(time_s)[joint] @ bind_from_object
            shift = np.eye(4)
            if deformation.targets is not None:
                # maximum displacement of vertices by morph targets
                change = deformation.weights_at(time_s) - deformation.weights_at(0.0)
                shift[0, 3] = np.abs(change) @ deformation.targets.longest
            matrix = instance.world_from_mesh @ shift @ matrix
            poses.append(matrix if index is None else world_from_objects[index] @ matrix)
        return poses
