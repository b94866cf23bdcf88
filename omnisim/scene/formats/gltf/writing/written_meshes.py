"""Nodes and meshes of an exported glTF file."""

from __future__ import annotations

import itertools
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from omnisim.scene.files.file_axes import world_from_axes
from omnisim.scene.files.imported_scene import make_mesh
from omnisim.scene.model import Scene
from omnisim.scene.parts import Instance, Mesh

_MAX_ERROR = 1e-6  # relative to a mesh's size, for vertices moved to the node's frame
_SAME = 1e-9
_UNIT = 5e-4  # tolerance for the length of normals in glTF's validator


class NodeMesh(NamedTuple):
    """Mesh of a glTF file: scene meshes that always occur together in a node.

    Attributes:
        meshes: indices of the scene meshes.
        node_from_meshes: (4, 4) transforms to apply to each mesh's vertices.
    """

    meshes: tuple[int, ...]
    node_from_meshes: tuple[NDArray[np.float64], ...]


def node_meshes(scene: Scene) -> tuple[list[dict[str, Any]], list[NodeMesh]]:
    """Nodes of the instances, in order, and the meshes that they reference.

    Parts of an instance with a common frame become one node with that frame's axes, and their
    vertices are moved into it. A mesh whose instances differ in this transform is left unchanged,
    and its nodes use its own frame.
    """
    file_from_world = world_from_axes("y", 1.0).T
    frames = _node_from_meshes(scene)
    nodes: list[dict[str, Any]] = []
    rows: dict[tuple[int, ...], int] = {}
    meshes: list[NodeMesh] = []
    for (name, _, _), group in itertools.groupby(enumerate(scene.instances), _node_key(frames)):
        parts = [one for _, one in group]
        indices = tuple(one.mesh for one in parts)
        node_from_meshes = [frames[index] for index in indices]
        matrix = file_from_world @ parts[0].world_from_mesh
        if node_from_meshes[0] is not None:
            matrix = file_from_world @ parts[0].world_from_node @ file_from_world.T
        if indices not in rows:
            rows[indices] = len(meshes)
            meshes.append(
                NodeMesh(
                    indices, tuple(np.eye(4) if one is None else one for one in node_from_meshes)
                )
            )
        nodes.append({"name": name, "mesh": rows[indices], "matrix": matrix.T.ravel().tolist()})
    return nodes, meshes


def baked_mesh(mesh: Mesh, node_from_mesh: NDArray[np.float64]) -> Mesh:
    """Mesh with vertices in the frame of its node, and unit normals."""
    linear = node_from_mesh[:3, :3]
    points = mesh.positions.astype(np.float64) @ linear.T + node_from_mesh[:3, 3]
    normals = mesh.normals
    if normals is not None:
        if not np.array_equal(linear, np.eye(3)):
            turned = normals.astype(np.float64) @ np.linalg.inv(linear)
            normals = turned.astype(np.float32)
        normals = _unit(normals)
    flips = np.linalg.det(linear) < 0.0
    return replace(
        mesh,
        positions=points.astype(np.float32),
        triangles=mesh.triangles[:, ::-1] if flips else mesh.triangles,
        normals=normals,
    )


def _node_key(
    frames: list[NDArray[np.float64] | None],
) -> Any:
    """Grouping key of the node of a numbered instance."""

    def key(numbered: tuple[int, Instance]) -> tuple[str, bytes, int]:
        number, one = numbered
        alone = frames[one.mesh] is None
        return one.name, one.world_from_node.tobytes(), number if alone else -1

    return key


def _node_from_meshes(scene: Scene) -> list[NDArray[np.float64] | None]:
    """Transform (4, 4) of each mesh to its nodes' frames, y up; None: the mesh's own frame."""
    matrices: list[NDArray[np.float64] | None] = [None] * len(scene.meshes)
    differs = [False] * len(scene.meshes)
    for one in scene.instances:
        matrix = _node_from_mesh(one)
        first = matrices[one.mesh]
        if matrix is None or (first is not None and not np.allclose(matrix, first, _SAME, _SAME)):
            differs[one.mesh] = True
        elif first is None:
            matrices[one.mesh] = matrix
    return [
        None if matrix is None or unlike or not _is_exact(mesh, matrix) else matrix
        for mesh, matrix, unlike in zip(scene.meshes, matrices, differs, strict=True)
    ]


def _node_from_mesh(one: Instance) -> NDArray[np.float64] | None:
    if not np.isfinite(np.linalg.cond(one.world_from_node)):
        return None
    file_from_world = world_from_axes("y", 1.0).T
    matrix: NDArray[np.float64] = file_from_world @ (
        np.linalg.inv(one.world_from_node) @ one.world_from_mesh
    )
    return matrix if abs(np.linalg.det(matrix[:3, :3])) > 0.0 else None


def _is_exact(mesh: Mesh, node_from_mesh: NDArray[np.float64]) -> bool:
    """True if the shape survives the float32 round trip in the node's frame."""
    baked = baked_mesh(replace(mesh, normals=None), node_from_mesh)
    read, center = make_mesh(mesh.name, baked.positions, mesh.triangles, 0)
    linear = node_from_mesh[:3, :3]
    expected = mesh.positions.astype(np.float64) @ linear.T + node_from_mesh[:3, 3] - center
    error = np.abs(read.positions - expected).max()
    return bool(error <= _MAX_ERROR * np.abs(expected).max())


def _unit(normals: NDArray[np.float32]) -> NDArray[np.float32]:
    """Unit normals (n, 3); zero-length ones become +y."""
    lengths = np.linalg.norm(normals, axis=1)
    off = np.abs(lengths - 1.0) > _UNIT
    if not off.any():
        return normals
    result = normals.copy()
    result[off] /= np.where(lengths > 0.0, lengths, 1.0)[off, None]
    result[lengths == 0.0] = (0.0, 1.0, 0.0)
    return result
