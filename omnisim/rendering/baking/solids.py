"""Closed parts of meshes, which count as solids: their inside is invisible."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from omnisim.scene.model import Mesh, Scene


def hollow_triangles(scene: Scene) -> NDArray[np.bool_]:
    """Mask (m,) of triangles with a visible back: double-sided, and not part of a solid.

    A solid is a closed part of a mesh without a start position of a camera inside. Frosted glass is
    lit from its back, also if it is closed or single-sided.
    """
    parts = {one: _closed_parts(scene.meshes[one]) for one in {i.mesh for i in scene.instances}}
    places = [scene.start.position_m, *(start.position_m for start in scene.starts)]
    hollow = [np.empty(0, np.bool_)]
    for instance in scene.instances:
        part_of, closed = parts[instance.mesh]
        mesh = scene.meshes[instance.mesh]
        material = scene.materials[mesh.material]
        if material.frosted_transmission > 0.0 and not scene.lighting.is_matte:
            hollow.append(np.ones(len(part_of), dtype=np.bool_))
            continue
        if not material.double_sided:
            hollow.append(np.zeros(len(part_of), dtype=np.bool_))
            continue
        corners = mesh.positions.astype(np.float64) @ instance.world_from_mesh[:3, :3].T
        corners = (corners + instance.world_from_mesh[:3, 3])[mesh.triangles]
        low, high = (np.full((len(closed), 3), sign * np.inf) for sign in (1, -1))
        np.minimum.at(low, part_of, corners.min(axis=1))
        np.maximum.at(high, part_of, corners.max(axis=1))
        holds = np.zeros(len(closed), dtype=np.bool_)
        for place in places:
            holds |= ((low < place) & (high > place)).all(axis=1)
        hollow.append(~(closed & ~holds)[part_of])
    return np.concatenate(hollow)


def instances_of(scene: Scene, is_chosen: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Mask (n,) of instances with at least one chosen triangle of (m,)."""
    counts = [len(scene.meshes[instance.mesh].triangles) for instance in scene.instances]
    ends = np.cumsum([0, *counts])
    before = np.concatenate(([0], np.cumsum(is_chosen)))
    some: NDArray[np.bool_] = before[ends[1:]] > before[ends[:-1]]
    return some


def _closed_parts(mesh: Mesh) -> tuple[NDArray[np.intp], NDArray[np.bool_]]:
    """Connected part (m,) of each triangle, and mask of closed parts: two triangles per edge."""
    _, welded = np.unique(mesh.positions, axis=0, return_inverse=True)
    corners = welded.reshape(-1)[mesh.triangles]
    count = int(corners.max(initial=-1)) + 1
    firsts, seconds = corners[:, [0, 1, 2]].ravel(), corners[:, [1, 2, 0]].ravel()
    ones = np.ones(len(firsts), dtype=np.int8)
    _, part_of_vertex = connected_components(
        coo_matrix((ones, (firsts, seconds)), shape=(count, count)), directed=False
    )
    part_of = part_of_vertex[corners[:, 0]].astype(np.intp)
    # in a closed part, each edge is traversed equally often in both directions
    keys, reverse = firsts.astype(np.int64) * count + seconds, seconds * np.int64(count) + firsts
    edges, of_both = np.unique(np.concatenate((keys, reverse)), return_inverse=True)
    balance = np.zeros(len(edges), dtype=np.intp)
    np.add.at(balance, of_both.reshape(-1)[: len(keys)], 1)
    np.add.at(balance, of_both.reshape(-1)[len(keys) :], -1)
    is_open = balance[of_both.reshape(-1)[: len(keys)]] != 0
    closed = np.ones(int(part_of.max(initial=-1)) + 1, dtype=np.bool_)
    closed[np.repeat(part_of, 3)[is_open]] = False
    return part_of, closed
