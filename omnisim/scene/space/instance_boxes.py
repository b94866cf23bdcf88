"""Oriented boxes of a scene's instances, aligned with their own frames."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from omnisim.core.arrays import Floats
from omnisim.core.poses import nearest_rotation
from omnisim.ground_truth.boxes_3d import OrientedBox
from omnisim.scene.parts import Instance, Mesh


def instance_boxes(
    instances: Sequence[Instance], meshes: Sequence[Mesh], time_s: float = 0.0
) -> dict[str, OrientedBox]:
    """Boxes by instance name at a world time, in the frame in which the instances are placed.

    All parts with one name share one box, which bounds them along the axes of the instance's frame,
    see `Scene.pose_of`.
    """
    parts: dict[str, list[Instance]] = {}
    for instance in instances:
        parts.setdefault(instance.name, []).append(instance)
    boxes = {}
    for name, of_name in parts.items():
        points_m = np.concatenate([_points_m(one, meshes[one.mesh], time_s) for one in of_name])
        if len(points_m):
            boxes[name] = OrientedBox.of_points(points_m, _axes(of_name[0]))
    return boxes


def _points_m(instance: Instance, mesh: Mesh, time_s: float) -> Floats:
    """Vertices (n, 3) used by an instance's triangles, at a world time."""
    used = np.unique(mesh.triangles).astype(np.intp)
    points = mesh.positions[used].astype(np.float64)
    if mesh.deformation is not None:
        points = mesh.deformation.positions_at(time_s, used)
    matrix = instance.world_from_mesh
    return points @ matrix[:3, :3].T + matrix[:3, 3]


def _axes(instance: Instance) -> Floats:
    """Rotation (3, 3) of an instance's frame, without scale, shear and mirroring."""
    axes = nearest_rotation(instance.world_from_node[:3, :3])
    return axes if np.linalg.det(axes) > 0.0 else -axes  # the box is the same for both signs
