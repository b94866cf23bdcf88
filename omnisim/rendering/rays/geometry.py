"""Geometry of scenes as flat tables: triangles, their corners and their instances."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import NamedTuple

import numpy as np

from omnisim.core.arrays import AnyFloats, Bools, Floats, Floats32, Indices, Ints32
from omnisim.core.world import ObjectPart, Poses, time_of
from omnisim.scene.model import Instance, Material, Mesh, Scene, Texture


class PlacedSurface(NamedTuple):
    """Instance of a mesh in the scene or in a dynamic object."""

    name: str  # name of the instance
    object_index: int | None  # index of the dynamic object; None: static
    material: Material  # material of the mesh
    is_textured: bool  # the mesh has texture coordinates
    has_second_coordinates: bool = False  # the mesh has a second set of texture coordinates
    is_lightmapped: bool = False  # the instance has a region in the lightmap
    # (4, 4) pose of the instance, in the world or the dynamic object's frame
    object_from_mesh: Floats = np.eye(4)

    def is_placed(self, texture: Texture) -> bool:
        """True if the mesh has the texture coordinates that a texture uses."""
        return self.has_second_coordinates if texture.uv_set else self.is_textured


_TIMES_KEPT = 8  # deformed vertices: an image, its neighbors, and several slices of a scan


class _DeformedVertices(NamedTuple):
    """Vertices of a surface at a time, in the frame of its part."""

    positions_m: Floats
    normals: Floats32 | None


@dataclass(frozen=True, eq=False)
class DeformingSurface:
    """Surface with a deforming mesh."""

    number: int  # index of the surface
    first_vertex: int  # first vertex in the geometry
    # instance and mesh of the surface
    instance: Instance
    mesh: Mesh

    @cached_property
    def at(self) -> Callable[[float], _DeformedVertices]:
        """Vertices by time in seconds; threads share those of the last times."""
        return lru_cache(maxsize=_TIMES_KEPT)(self._vertices_at)

    def _vertices_at(self, time_s: float) -> _DeformedVertices:
        deformation = self.mesh.deformation
        assert deformation is not None
        linear = self.instance.world_from_mesh[:3, :3]
        positions = np.einsum("nj,ij->ni", deformation.positions_at(time_s), linear)
        normals = deformation.normals_at(time_s)
        return _DeformedVertices(
            positions + self.instance.world_from_mesh[:3, 3],
            None if normals is None else _turned(normals, linear),
        )


@dataclass(frozen=True, eq=False)
class Geometry:
    """Triangles of a scene and its dynamic objects, each object in its own frame, at 0 s."""

    surfaces: tuple[PlacedSurface, ...]  # all instances, first the scene's, then each object's
    corners: Ints32  # (m, 3) int32 vertex indices, counter-clockwise seen from the front
    surface_of_triangle: Ints32  # (m,) int32 surface index
    first_of_surface: Indices  # (surfaces + 1,) first triangle of each surface
    positions_m: Floats  # (n, 3) float64 vertices
    normals: Floats32  # (n, 3) float32, not of unit length; zero: flat
    texture_coordinates: Floats32  # (n, 2) float32
    second_coordinates: Floats32 | None  # (n, 2) float32; None: no mesh has a second set
    # (n, 4) float32 lightmap coordinates of front and back; None: no lightmap
    light_coordinates: Floats32 | None
    colors: Floats32 | None  # (n, 4) float32 linear RGBA; None: all are white
    part_of_surface: Indices  # (surfaces,) 0: the scene; 1 + index of the dynamic object
    is_double_sided: Bools  # (surfaces,) True for double-sided materials
    deforming: tuple[DeformingSurface, ...] = ()  # surfaces whose vertices change over time

    @property
    def draws(self) -> list[ObjectPart]:
        """Index of the dynamic object (None: static) and name of each surface's instance."""
        return [(surface.object_index, surface.name) for surface in self.surfaces]

    def triangles_of_part(
        self, part: int, hidden: frozenset[ObjectPart], deforming: bool = False
    ) -> Indices:
        """Indices (n,) of a part's triangles, rigid or deforming, without hidden instances."""
        deform = {deforming.number for deforming in self.deforming}
        shown = np.array(
            [
                of_part == part
                and (number in deform) is deforming
                and (surface.object_index, surface.name) not in hidden
                for number, (surface, of_part) in enumerate(
                    zip(self.surfaces, self.part_of_surface, strict=True)
                )
            ],
            dtype=np.bool_,
        )
        return np.flatnonzero(np.repeat(shown, np.diff(self.first_of_surface)))

    def part_of_triangles(self, triangles: Ints32) -> Indices:
        """Parts (n,) of triangles (n,)."""
        return self.part_of_surface[self.surface_of_triangle[triangles]]

    def corners_m(self, triangles: Ints32, world_from_objects: Poses = ()) -> Floats:
        """Corners (n, 3, 3) of triangles (n,), world, with the dynamic objects at poses (4, 4)."""
        corners_m = self.positions_m[self.corners[triangles]]
        for selected, deforming in self.deformed(triangles):
            positions_m = deforming.at(time_of(world_from_objects)).positions_m
            corners_m[selected] = positions_m[
                self.corners[triangles[selected]] - deforming.first_vertex
            ]
        for selected, pose in self.moved(triangles, world_from_objects):
            rotated = np.einsum("nkj,ij->nki", corners_m[selected], pose[:3, :3])
            corners_m[selected] = rotated + pose[:3, 3]
        return corners_m

    def corner_normals(self, triangles: Ints32, world_from_objects: Poses = ()) -> Floats32:
        """Normals (n, 3, 3) at the corners of triangles (n,), each in the frame of its part."""
        normals: Floats32 = self.normals[self.corners[triangles]]
        for selected, deforming in self.deformed(triangles):
            deformed_normals = deforming.at(time_of(world_from_objects)).normals
            if deformed_normals is not None:
                normals[selected] = deformed_normals[
                    self.corners[triangles[selected]] - deforming.first_vertex
                ]
        return normals

    def deformed(self, triangles: Ints32) -> Iterator[tuple[Indices, DeformingSurface]]:
        """Indices of the deforming ones among triangles (n,), with their surface."""
        if not self.deforming:
            return
        surfaces = self.surface_of_triangle[triangles]
        for deforming in self.deforming:
            selected = np.flatnonzero(surfaces == deforming.number)
            if len(selected):
                yield selected, deforming

    def moved(
        self, triangles: Ints32, world_from_objects: Poses
    ) -> Iterator[tuple[Indices, Floats]]:
        """Indices of the triangles (n,) of each dynamic object, with its pose (4, 4)."""
        if not world_from_objects:
            return
        parts = self.part_of_triangles(triangles)
        for number, pose in enumerate(world_from_objects, start=1):
            selected = np.flatnonzero(parts == number)
            if len(selected):
                yield selected, pose


def build_geometry(scene: Scene, dynamic_objects: Sequence[Scene] = ()) -> Geometry:
    """Build the tables of a scene and its dynamic objects."""
    placed = [
        (number, part, instance, part.meshes[instance.mesh])
        for number, part in enumerate((scene, *dynamic_objects))
        for instance in part.instances
    ]
    materials = [part.materials[mesh.material] for _, part, _, mesh in placed]
    tables = [_EMPTY, *(_vertices(instance, mesh) for *_, instance, mesh in placed)]
    second = [
        _floats(len(mesh.positions), 2) if coordinates is None else coordinates
        for *_, mesh in placed
        for coordinates in (mesh.second_texture_coordinates,)
    ]
    has_second = any(mesh.second_texture_coordinates is not None for *_, mesh in placed)
    has_colors = any(mesh.colors is not None for *_, mesh in placed)
    counts = np.array([len(mesh.triangles) for *_, mesh in placed], dtype=np.intp)
    bases = np.cumsum([0, *(len(table.positions_m) for table in tables[:-1])])
    deforming = tuple(
        DeformingSurface(surface, int(bases[1 + surface]), instance, mesh)
        for surface, (*_, instance, mesh) in enumerate(placed)
        if mesh.deformation is not None
    )
    return Geometry(
        surfaces=tuple(
            PlacedSurface(
                instance.name,
                number - 1 if number else None,
                material,
                mesh.texture_coordinates is not None,
                mesh.second_texture_coordinates is not None,
                not number
                and scene.lighting.baked is not None
                and instance.light_rectangle is not None
                and mesh.light_coordinates is not None,
                instance.world_from_mesh,
            )
            for (number, _, instance, mesh), material in zip(placed, materials, strict=True)
        ),
        corners=np.concatenate(
            [table.corners + np.int32(base) for table, base in zip(tables, bases, strict=True)]
        ),
        surface_of_triangle=np.repeat(np.arange(len(placed), dtype=np.int32), counts),
        first_of_surface=np.concatenate(([0], np.cumsum(counts))),
        positions_m=np.concatenate([table.positions_m for table in tables]),
        normals=np.concatenate([table.normals for table in tables]),
        texture_coordinates=np.concatenate([table.texture_coordinates for table in tables]),
        second_coordinates=np.concatenate(second) if has_second else None,
        light_coordinates=_light_coordinates(scene, dynamic_objects),
        colors=np.concatenate([table.colors for table in tables]) if has_colors else None,
        part_of_surface=np.array([number for number, *_ in placed], dtype=np.intp),
        is_double_sided=np.array([material.double_sided for material in materials], np.bool_),
        deforming=deforming,
    )


def _light_coordinates(scene: Scene, dynamic_objects: Sequence[Scene]) -> Floats32 | None:
    """Lightmap coordinates (n, 4) of all vertices; None: the scene has no lightmap."""
    if scene.lighting.baked is None:
        return None
    places = []
    for instance in scene.instances:
        mesh, rectangle = scene.meshes[instance.mesh], instance.light_rectangle
        if mesh.light_coordinates is None or rectangle is None:
            places.append(_floats(len(mesh.positions), 4))
        else:
            sides = np.array((rectangle, instance.light_back_rectangle or rectangle))
            own = sides[:, :2] + mesh.light_coordinates[:, None] * sides[:, 2:]
            places.append(own.reshape(-1, 4).astype(np.float32))
    others = [
        _floats(len(part.meshes[instance.mesh].positions), 4)
        for part in dynamic_objects
        for instance in part.instances
    ]
    return np.concatenate([_floats(0, 4), *places, *others])


class _Vertices(NamedTuple):
    """Triangles and vertices of one instance, in the frame of its scene."""

    corners: Ints32
    positions_m: Floats
    normals: Floats32
    texture_coordinates: Floats32
    colors: Floats32


def _floats(rows: int, columns: int, value: float = 0.0) -> Floats32:
    return np.full((rows, columns), value, dtype=np.float32)


_EMPTY = _Vertices(
    np.empty((0, 3), np.int32), np.empty((0, 3)), _floats(0, 3), _floats(0, 2), _floats(0, 4)
)


def _vertices(instance: Instance, mesh: Mesh) -> _Vertices:
    count, matrix = len(mesh.positions), instance.world_from_mesh
    linear = matrix[:3, :3]
    is_mirrored = np.linalg.det(linear) < 0.0
    corners = mesh.triangles.astype(np.int32)
    # einsum instead of BLAS, whose threads would keep spinning and occupy cores afterwards
    positions_m = np.einsum("nj,ij->ni", mesh.positions.astype(np.float64), linear)
    normals = _floats(count, 3) if mesh.normals is None else _turned(mesh.normals, linear)
    coordinates, colors = mesh.texture_coordinates, mesh.colors
    return _Vertices(
        corners[:, [0, 2, 1]] if is_mirrored else corners,  # mirroring reverses the winding
        positions_m + matrix[:3, 3],
        normals,
        _floats(count, 2) if coordinates is None else coordinates,
        _floats(count, 4, 1.0) if colors is None else colors,
    )


def _turned(normals: AnyFloats, linear: Floats) -> Floats32:
    """Normals (n, 3) transformed by the cofactors of a matrix (3, 3), which keep them outward."""
    cofactors = np.cross(linear[[1, 2, 0]], linear[[2, 0, 1]])
    if np.linalg.det(linear) < 0.0:
        cofactors = -cofactors
    return np.einsum("nj,ij->ni", normals, cofactors).astype(np.float32)
