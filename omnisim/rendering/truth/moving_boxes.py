"""Bounding boxes of moving parts: dynamic objects, and the vertices bound to each joint."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from omnisim.core.arrays import Floats
from omnisim.core.world import Pose, time_of
from omnisim.scene import Scene
from omnisim.scene.model import Instance
from omnisim.scene.motion.deformation import Deformation

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
        self.corners_m = [_corners_m(one.bounds_m()) for one in objects]
        self._joints: list[_JointBox] = []
        for index, part in enumerate((scene, *objects), start=-1):
            for instance in part.instances:
                deformation = part.meshes[instance.mesh].deformation
                if deformation is not None:
                    self._add(index if index >= 0 else None, instance, deformation)

    def _add(self, object_index: int | None, instance: Instance, deformation: Deformation) -> None:
        matrices = instance.world_from_mesh @ deformation.matrices_at(0.0)
        joints, corners = deformation.joint_boxes()
        for joint, of_joint in zip(joints.tolist(), corners, strict=True):
            matrix = matrices[joint]
            size = float(np.linalg.norm(matrix[:3, :3], 2))
            if abs(np.linalg.det(matrix[:3, :3])) > _MIN_VOLUME * size**3:
                inverse = np.linalg.inv(matrix)
                box = _JointBox(object_index, instance, deformation, joint, inverse)
                self._joints.append(box)
                self.corners_m.append(of_joint @ matrix[:3, :3].T + matrix[:3, 3])

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


def _corners_m(box_m: Floats) -> Floats:
    corners = np.array(list(itertools.product(*box_m.T)))
    return corners if np.isfinite(corners).all() else corners[:0]
