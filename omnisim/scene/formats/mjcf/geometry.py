"""Triangles of a MuJoCo model's geoms, each in its geom's frame."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from omnisim.core.errors import SceneError
from omnisim.scene.primitives import (
    Surface,
    box,
    capsule,
    cylinder,
    ellipsoid,
    grid_triangles,
    join,
    rectangle,
    segments,
)

Geom = mujoco.mjtGeom
# Minimum half size of an infinite plane, which otherwise reaches MuJoCo's far clipping plane.
MIN_REACH_M = 100.0


class Shape(NamedTuple):
    """Surface of a geom, with the inputs of texture mapping.

    Attributes:
        surface: triangles, m.
        texture_coordinates: (n, 2) from the mesh file; None: not in the file.
        scaled: (n, 3) positions divided by the geom's sizes, as MuJoCo's renderer scales its
            built-in shapes; they map textures without coordinates.
    """

    surface: Surface
    texture_coordinates: NDArray[np.float64] | None
    scaled: NDArray[np.float64]


def geom_shape(model: mujoco.MjModel, geom: int) -> Shape:
    """Shape of a geom; a signed distance field takes the shape of its mesh.

    Raises:
        SceneError: a size that is not finite.
    """
    kind, size = Geom(int(model.geom_type[geom])), model.geom_size[geom]
    if not np.isfinite(size).all():
        name = model.geom(geom).name or str(geom)
        raise SceneError(f"geom {name}: size: expected finite numbers, got {size.tolist()}")
    data = int(model.geom_dataid[geom])
    if kind in (Geom.mjGEOM_MESH, Geom.mjGEOM_SDF):
        surface, coordinates = _mesh(model, data)
        return Shape(surface, coordinates, _scaled(surface, size))
    if kind == Geom.mjGEOM_HFIELD:
        surface = _height_field(model, data)
        return Shape(surface, None, _scaled(surface, model.hfield_size[data][:3]))
    if kind == Geom.mjGEOM_PLANE:
        reach_m = max(float(model.vis.map.zfar * model.stat.extent), MIN_REACH_M)
        surface = rectangle(*(float(half) if half > 0.0 else reach_m for half in size[:2]))
        return Shape(surface, None, _scaled(surface, size))
    return _PRIMITIVES[kind](size)


def _scaled(surface: Surface, sizes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Positions divided by sizes (3,); sizes of 0 count as 1."""
    return surface.positions / np.where(sizes > 0.0, sizes, 1.0)


def _of_sizes(surface: Surface, sizes: NDArray[np.float64]) -> Shape:
    return Shape(surface, None, _scaled(surface, sizes))


def _capsule(size: NDArray[np.float64]) -> Shape:
    """Capsule, with hemispheres scaled by the radius, measured from the ends of the tube."""
    radius, half = float(size[0]), float(size[1])
    surface = capsule(radius, half)
    scaled = surface.positions / (radius, radius, half)
    domes = slice(2 * (segments(radius) + 1), None)  # vertices after those of the tube
    z = surface.positions[domes, 2]
    scaled[domes, 2] = np.sign(z) * (1.0 + (np.abs(z) - half) / radius)
    return Shape(surface, None, scaled)


_PRIMITIVES: dict[mujoco.mjtGeom, Callable[[NDArray[np.float64]], Shape]] = {
    Geom.mjGEOM_SPHERE: lambda size: _of_sizes(ellipsoid(size[[0, 0, 0]]), size[[0, 0, 0]]),
    Geom.mjGEOM_ELLIPSOID: lambda size: _of_sizes(ellipsoid(size), size),
    Geom.mjGEOM_CYLINDER: lambda size: _of_sizes(
        cylinder(float(size[0]), float(size[1])), size[[0, 0, 1]]
    ),
    Geom.mjGEOM_BOX: lambda size: _of_sizes(box(size), size),
    Geom.mjGEOM_CAPSULE: _capsule,
}


def _mesh(model: mujoco.MjModel, mesh: int) -> tuple[Surface, NDArray[np.float64] | None]:
    """Surface and texture coordinates (n, 2) of a mesh, whose faces index both separately."""
    faces = slice(
        int(model.mesh_faceadr[mesh]), int(model.mesh_faceadr[mesh] + model.mesh_facenum[mesh])
    )
    positions = _rows(model.mesh_vert, model.mesh_vertadr, model.mesh_vertnum, mesh)
    normals = _rows(model.mesh_normal, model.mesh_normaladr, model.mesh_normalnum, mesh)
    corners = [model.mesh_face[faces].ravel(), model.mesh_facenormal[faces].ravel()]
    coordinates = None
    if int(model.mesh_texcoordadr[mesh]) >= 0:
        coordinates = _rows(
            model.mesh_texcoord, model.mesh_texcoordadr, model.mesh_texcoordnum, mesh
        )
        corners.append(model.mesh_facetexcoord[faces].ravel())
    vertices, triangles = np.unique(np.stack(corners, axis=1), axis=0, return_inverse=True)
    surface = Surface(
        positions[vertices[:, 0]],
        triangles.reshape(-1, 3).astype(np.int64),
        normals[vertices[:, 1]],
    )
    return surface, None if coordinates is None else coordinates[vertices[:, 2]]


def _rows(
    values: NDArray[np.float32], starts: NDArray[np.int32], counts: NDArray[np.int32], index: int
) -> NDArray[np.float64]:
    start = int(starts[index])
    return values[start : start + int(counts[index])].astype(np.float64)


def _height_field(model: mujoco.MjModel, field: int) -> Surface:
    """Height field with its sides and base, flat-shaded as in MuJoCo."""
    rows, columns = int(model.hfield_nrow[field]), int(model.hfield_ncol[field])
    half_x, half_y, top, base = (float(size) for size in model.hfield_size[field])
    start = int(model.hfield_adr[field])
    heights = model.hfield_data[start : start + rows * columns].reshape(rows, columns)
    x = np.linspace(-half_x, half_x, columns)
    y = np.linspace(-half_y, half_y, rows)
    positions = np.stack(
        np.broadcast_arrays(x, y[:, None], heights.astype(np.float64) * top), axis=-1
    )
    edges = (positions[0], positions[:, -1], positions[-1, ::-1], positions[::-1, 0])
    bottom = rectangle(half_x, half_y)
    return join(
        Surface(positions.reshape(-1, 3), grid_triangles(rows, columns), None),
        *(_side(edge, -base) for edge in edges),
        Surface(bottom.positions - (0.0, 0.0, base), bottom.triangles[:, ::-1], None),
    )


def _side(edge: NDArray[np.float64], base: float) -> Surface:
    """Wall from an edge (n, 3) down to a height."""
    below = edge.copy()
    below[:, 2] = base
    return Surface(np.concatenate((below, edge)), grid_triangles(2, len(edge)), None)
