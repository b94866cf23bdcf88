"""Buffers of a scene and its dynamic objects on the GPU, and the items to draw from them.

A dynamic object is a scene in a frame of its own, which has another pose in the world in each
frame. Its geometry stays where it is; only matrices change.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from functools import cached_property

import moderngl
import numpy as np
from numpy.typing import NDArray

from omnisim.errors import GraphicsError
from omnisim.gpu.scene.draw_item import DrawItem, InstanceTransforms
from omnisim.gpu.scene.static_geometry import StaticGeometry, build_static_geometry
from omnisim.gpu.scene.textures import MaterialTextures
from omnisim.gpu.scene.triangle_table import TriangleTable
from omnisim.gpu.scene.vertex_format import VERTEX, fill_vertices
from omnisim.scene.model import AlphaMode, Scene
from omnisim.world import ObjectPart


class SceneBuffers:
    """Uploads a scene and its dynamic objects once; the passes of all sensors draw from it.

    Args:
        context: where.
        scene: the static part of the world.
        dynamic_objects: those in it; their lights, backgrounds and starts count for nothing.
        uses_clusters: draw static instances by clusters of their triangles. Without, every
            instance is drawn whole, one after the other: slower, but with little to go wrong, the
            reference for what is faster.

    Attributes:
        context: as given.
        vertices, indices: the two buffers.
        draw_items: opaque and masked instances, then blended ones; within each by material.
        radii_m: (n,) of their bounding spheres.

    Raises:
        GraphicsError: a texture past the limits of the GPU.
    """

    def __init__(
        self,
        context: moderngl.Context,
        scene: Scene,
        dynamic_objects: Sequence[Scene] = (),
        *,
        uses_clusters: bool = True,
    ):
        self.context, self._lighting = context, scene.lighting
        self._uses_clusters = uses_clusters
        parts = (scene, *dynamic_objects)
        textures = MaterialTextures(context)
        vertices, indices, offsets = _concatenate_meshes(parts)
        self.vertices, self.indices = context.buffer(vertices), context.buffer(indices)
        items = [
            item
            for number, part in enumerate(parts)
            for item in _draw_items(part, number - 1 if number else None, offsets[number], textures)
        ]
        materials = [material for part in parts for material in part.materials]
        rank = {id(material): rank for rank, material in enumerate(materials)}
        items.sort(key=lambda item: (item.is_blended, rank[id(item.material)]))
        self.draw_items = tuple(items)
        self.radii_m = np.array([item.radius_m for item in items])
        self._rest_transforms = (
            np.array([item.object_from_mesh for item in items]),
            np.array([item.normal_from_mesh for item in items]),
            np.array([item.centre_m for item in items]),
        )
        object_indices = [-1 if one.object_index is None else one.object_index for one in items]
        self._object_of_item = np.array(object_indices, dtype=np.intp)
        self._dynamic = np.flatnonzero(self._object_of_item >= 0)

    def instance_transforms(
        self,
        viewpoint_m: NDArray[np.float64],
        world_from_objects: Sequence[NDArray[np.float64]] = (),
    ) -> InstanceTransforms:
        """Transforms of the items into the frame of a viewpoint (3,), world.

        Args:
            viewpoint_m: (3,), world.
            world_from_objects: (4, 4) each, poses of the dynamic objects.
        """
        world_from_mesh, normal_from_mesh, centres_m = (one.copy() for one in self._rest_transforms)
        if self._dynamic.size:
            dynamic = self._dynamic
            world_from_object = np.stack(world_from_objects)[self._object_of_item[dynamic]]
            rotation = world_from_object[:, :3, :3]
            world_from_mesh[dynamic] = world_from_object @ world_from_mesh[dynamic]
            # a rotation is its own matrix of cofactors
            normal_from_mesh[dynamic] = rotation @ normal_from_mesh[dynamic]
            centres_m[dynamic] = (rotation @ centres_m[dynamic, :, None])[..., 0]
            centres_m[dynamic] += world_from_object[:, :3, 3]
        world_from_mesh[:, :3, 3] -= viewpoint_m  # in float64: far from the origin counts too
        return InstanceTransforms(world_from_mesh, normal_from_mesh, centres_m - viewpoint_m)

    def front_to_back(
        self, items: NDArray[np.intp], transforms: InstanceTransforms
    ) -> NDArray[np.intp]:
        """Sort items (n,), near ones first and those that surround them last: little overdraw."""
        far_m = np.linalg.norm(transforms.centres_m[items], axis=1) + self.radii_m[items]
        return items[np.argsort(far_m, kind="stable")]

    def shown(self, hidden: Collection[ObjectPart] = ()) -> NDArray[np.bool_]:
        """Mask (n,) of the items without these parts of dynamic objects."""
        return np.array([(item.object_index, item.name) not in hidden for item in self.draw_items])

    def shown_one_by_one(self, hidden: Collection[ObjectPart] = ()) -> NDArray[np.bool_]:
        """Mask (n,) of the shown items that are not part of the static geometry."""
        shown = self.shown(hidden)
        return shown if self.static_geometry is None else shown & ~self.static_geometry.contains

    @cached_property
    def triangles(self) -> TriangleTable:
        """Corners of all triangles, for lookups of single ones."""
        return TriangleTable(self.context, self.draw_items, self.indices)

    @cached_property
    def static_geometry(self) -> StaticGeometry | None:
        """Clusters of the static instances; None where there are none."""
        if not self._uses_clusters:
            return None
        return build_static_geometry(self.context, self.draw_items, self._lighting)

    def check_readable(self, purpose: str) -> None:
        """Refuse a scene whose triangles shaders cannot read.

        Raises:
            GraphicsError: naming the size, the limit, and the purpose.
        """
        limit = int(self.context.info["GL_MAX_SHADER_STORAGE_BLOCK_SIZE"])
        largest = max(self.vertices.size, self.indices.size)
        if largest > limit:
            raise GraphicsError(
                f"the scene's triangles take {largest} bytes: {purpose} this GPU allows {limit}"
            )

    def sort_triangles(self, item: DrawItem, viewpoint_from_mesh: NDArray[np.float64]) -> None:
        """Sort the triangles of a blended item in the index buffer, back to front.

        Args:
            item: which.
            viewpoint_from_mesh: (4, 4).
        """
        mesh = item.mesh
        centres = mesh.positions[mesh.triangles].mean(axis=1, dtype=np.float64)
        centres = centres @ viewpoint_from_mesh[:3, :3].T + viewpoint_from_mesh[:3, 3]
        order = np.argsort(-np.sum(centres**2, axis=1), kind="stable")
        self.indices.write(
            (mesh.triangles[order] + np.uint32(item.base)).astype("<u4"), offset=4 * item.first
        )


def _concatenate_meshes(
    parts: Sequence[Scene],
) -> tuple[NDArray[np.void], NDArray[np.uint32], list[list[tuple[int, int]]]]:
    """Concatenate all meshes; instances share their indices, but for blended ones, sorted apart.

    Returns:
        Vertices (n,), indices (m,), and first index and first vertex of each scene's instances.
    """
    vertices = np.zeros(
        sum(len(mesh.positions) for part in parts for mesh in part.meshes), dtype=VERTEX
    )
    indices: list[NDArray[np.uint32]] = []
    offsets: list[list[tuple[int, int]]] = []
    base = first = 0
    for part in parts:
        bases = []
        for mesh in part.meshes:
            fill_vertices(vertices[base : base + len(mesh.positions)], mesh)
            bases.append(base)
            base += len(mesh.positions)
        shared: dict[int, int] = {}
        offsets.append([])
        for instance in part.instances:
            mesh = part.meshes[instance.mesh]
            is_blended = part.materials[mesh.material].alpha_mode is AlphaMode.BLEND
            if is_blended or instance.mesh not in shared:
                indices.append(mesh.triangles.ravel() + np.uint32(bases[instance.mesh]))
                shared[instance.mesh] = first
                first += mesh.triangles.size
            offsets[-1].append((shared[instance.mesh], bases[instance.mesh]))
    return vertices, np.concatenate(indices).astype("<u4"), offsets


def _draw_items(
    part: Scene,
    object_index: int | None,
    offsets: Sequence[tuple[int, int]],
    textures: MaterialTextures,
) -> list[DrawItem]:
    """Draw items of one scene's instances, whose meshes have offsets in the two buffers."""
    if not part.instances:
        return []
    # all at once: one by one these take longer than the whole upload
    linear = np.array([instance.world_from_mesh[:3, :3] for instance in part.instances])
    flips_winding = np.linalg.det(linear) < 0.0
    cofactors = np.cross(linear[:, [1, 2, 0]], linear[:, [2, 0, 1]])
    cofactors[flips_winding] *= -1.0
    scales = np.linalg.norm(linear, 2, axis=(1, 2))
    items = []
    for number, instance in enumerate(part.instances):
        mesh = part.meshes[instance.mesh]
        material = part.materials[mesh.material]
        centre = 0.5 * (mesh.positions.min(axis=0) + mesh.positions.max(axis=0))
        radius = np.linalg.norm(mesh.positions - centre, axis=1).max()
        object_from_mesh = instance.world_from_mesh
        items.append(
            DrawItem(
                name=instance.name,
                object_index=object_index,
                mesh=mesh,
                first=offsets[number][0],
                count=mesh.triangles.size,
                base=offsets[number][1],
                material=material,
                texture=textures.find(material, mesh),
                object_from_mesh=object_from_mesh,
                normal_from_mesh=cofactors[number],
                flips_winding=bool(flips_winding[number]),
                centre_m=object_from_mesh[:3, :3] @ centre + object_from_mesh[:3, 3],
                radius_m=float(radius) * float(scales[number]),
            )
        )
    return items
