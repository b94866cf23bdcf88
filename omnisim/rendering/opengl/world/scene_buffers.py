"""GPU buffers of a scene and its dynamic objects, and the items to draw from them.

A dynamic object is a scene in its own frame, with a new world pose per frame. Its geometry is
uploaded once; only matrices change. The GPU rewrites the vertices of deforming meshes.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from functools import cached_property

import moderngl
import numpy as np

from omnisim.core.arrays import Bools, Floats, Indices, bounds_of
from omnisim.core.errors import GraphicsError
from omnisim.core.world import ObjectPart, Poses, time_of
from omnisim.rendering.camera.quality import MAX_PROBES
from omnisim.rendering.contract import ScenePoses
from omnisim.rendering.opengl.world.clustered_geometry import (
    ClusteredGeometry,
    build_clustered_geometry,
)
from omnisim.rendering.opengl.world.draw_item import DrawItem, InstanceTransforms, LightSource
from omnisim.rendering.opengl.world.geometry_store import (
    MAX_WINDOWS,
    GeometryStore,
    TriangleTable,
    geometry_key,
    window_bytes,
)
from omnisim.rendering.opengl.world.mesh_deformer import MeshDeformer
from omnisim.rendering.opengl.world.scene_textures import (
    MaterialRecords,
    MaterialTextures,
    vertex_details,
)
from omnisim.scene.model import Instance, Scene
from omnisim.scene.parts import LightRectangle
from omnisim.scene.reflection_probes import find_reflectors
from omnisim.scene.surface_kind import SurfaceKind, kind_of

# Extensions of OpenGL 4.5 that are part of 4.6.
_CALLS_OF_CLUSTERS = {"GL_ARB_indirect_parameters", "GL_ARB_shader_draw_parameters"}
_OF_VERTICES = ("item_details", "light_coordinates")  # made again when meshes are added


class SceneBuffers:
    """Uploads a scene and its dynamic objects once, for the passes of all sensors.

    Args:
        scene: static part of the world.
        dynamic_objects: moving scenes; their lights, backgrounds and starts are ignored.
        uses_clusters: draw opaque and masked instances by clusters of triangles. False draws every
            instance whole, one after the other: slower but simpler, the reference for clusters.

    Attributes:
        draw_items: opaque and masked instances, then blended ones; each part sorted by material.
        radii_m: (n,) radii of their bounding spheres at 0 s.
        deforming: indices of items whose meshes deform.
        mirrors, pane_mirrors: planes of the planar mirrors and of panes; their surfaces are items.
        reflectors: these planes, and reflection probes; their surfaces are items.
        version: number of updates so far.

    Raises:
        GraphicsError: a texture beyond the limits of the GPU.
    """

    def __init__(
        self,
        context: moderngl.Context,
        scene: Scene,
        dynamic_objects: Sequence[Scene] = (),
        *,
        uses_clusters: bool = True,
    ):
        self.context, self._uses_clusters, self.version = context, uses_clusters, 0
        self._dynamic_objects = tuple(dynamic_objects)
        self._textures = MaterialTextures(context, scene.lighting.is_matte)
        self._build(scene)

    def _build(self, scene: Scene) -> None:
        """Upload everything."""
        self._lighting = scene.lighting
        parts = (scene, *self._dynamic_objects)
        self._textures.keep(())
        self._textures.share(
            [
                (part.materials[part.meshes[instance.mesh].material], part.meshes[instance.mesh])
                for part in parts
                for instance in part.instances
            ]
        )
        self._store = GeometryStore(self.context, parts)
        items = [
            item
            for number, part in enumerate(parts)
            for item in make_draw_items(
                part,
                part.instances,
                number - 1 if number else None,
                self._store.offsets[number],
                self._textures,
                scene.lighting.baked is not None,
            )
        ]
        materials = [material for part in parts for material in part.materials]
        rank = {id(material): rank for rank, material in enumerate(materials)}
        items.sort(key=lambda item: (item.is_blended, rank[id(item.material)]))
        self._set_items(items)
        self._is_drawn, self._free = np.ones(len(items), dtype=np.bool_), set[int]()
        for name in ("triangles", "clustered_geometry", *_OF_VERTICES):
            self.__dict__.pop(name, None)
        self._find_mirrors(np.ones(len(items), dtype=np.bool_))

    def _find_mirrors(self, possible: Bools) -> None:
        """Find planar mirrors, panes and probes among the possible items (n,), which are drawn."""
        drawn = np.flatnonzero(self._is_drawn).tolist()
        surfaces = {number: self.draw_items[number].surface for number in drawn}
        found = find_reflectors(surfaces, np.flatnonzero(possible).tolist())
        self.reflectors, self.mirrors, self.pane_mirrors = found, found.mirrors, found.panes

    def _set_items(self, items: Sequence[DrawItem]) -> None:
        self.draw_items = tuple(items)
        self.radii_m = np.array([item.radius_m for item in items])
        self._rest_transforms = (
            np.array([item.object_from_mesh for item in items]).reshape(-1, 4, 4),
            np.array([item.normal_from_mesh for item in items]).reshape(-1, 3, 3),
            np.array([item.center_m for item in items]).reshape(-1, 3),
        )
        object_indices = [-1 if item.object_index is None else item.object_index for item in items]
        self._object_of_item = np.array(object_indices, dtype=np.intp)
        self._dynamic = np.flatnonzero(self._object_of_item >= 0)
        self.deforming = np.flatnonzero([item.mesh.deformation is not None for item in items])
        self._deformer: MeshDeformer | None = None
        self._posed: tuple[bytes, InstanceTransforms] | None = None  # poses of objects, and world
        self._deformed_spheres: tuple[float, Floats, Floats] | None = None

    @property
    def materials(self) -> MaterialRecords:
        """Records of the materials that are not matte."""
        return self._textures.table

    @cached_property
    def item_details(self) -> moderngl.Texture | None:
        """Vertex details, see `vertex_details`; None: no item has second texture coordinates."""
        placed = [
            (index_range.mesh, 0, index_range.base)
            for index_range in self._store.ranges
            if index_range.mesh.second_texture_coordinates is not None
        ]
        return vertex_details(self.context, placed) if placed else None

    @cached_property
    def light_coordinates(self) -> moderngl.Buffer | None:
        """Lightmap coordinates of the vertices; None: no baked light."""
        return None if self._lighting.baked is None else self._store.light_coordinates()

    @property
    def vertices(self) -> moderngl.Buffer:
        """Vertices of all meshes, for lookups."""
        return self._store.upload_all()[0]

    @property
    def indices(self) -> moderngl.Buffer:
        """Indices of all draw items, for lookups."""
        return self._store.upload_all()[1]

    def buffers_of(self, items: Indices) -> tuple[moderngl.Buffer, moderngl.Buffer]:
        """Buffers of vertices and indices that have at least those of some items (n,)."""
        return self._store.upload([self.draw_items[index] for index in items.tolist()])

    def update(self, scene: Scene) -> None:
        """Draw another scene with the same lights; passes must `refresh` before the next frame.

        Items of unchanged instances keep their index, and their place in the clustered geometry.
        New ones are drawn one by one, in the place of removed items. Once much has been appended,
        everything is uploaded again, so rarely that it costs no more than appending.
        """
        self.version += 1
        static = self._static_mask
        added, drawn = _changed(scene, self.draw_items, static)
        offsets, ranges = [], len(self._store.ranges)
        for instance in added:
            mesh = scene.meshes[instance.mesh]
            is_sorted = bool(kind_of(scene.materials[mesh.material]) & SurfaceKind.SEE_THROUGH)
            offsets.append(self._store.place(mesh, is_sorted))
        for name in _OF_VERTICES if len(self._store.ranges) > ranges else ():
            self.__dict__.pop(name, None)
        if self._store.is_overgrown:
            self._build(scene)
            return
        is_baked = self._lighting.baked is not None
        new = make_draw_items(scene, added, None, offsets, self._textures, is_baked)
        # no failure from here on
        free = np.flatnonzero(~drawn & ~static).tolist()
        for index in set(free) - self._free:
            self._store.release(self.draw_items[index])
        items = list(self.draw_items)
        numbers = [*free, *range(len(items), len(items) + max(0, len(new) - len(free)))]
        for index, item in zip(numbers, new, strict=False):
            items[index : index + 1] = [item]
        self._set_items(items)
        self._free = set(numbers[len(new) :])
        self._is_drawn = np.append(drawn, np.ones(len(items) - len(drawn), dtype=np.bool_))
        self._is_drawn[numbers[: len(new)]] = True
        if self.clustered_geometry is not None:
            self.clustered_geometry.show(self._is_drawn)
        self._find_mirrors(self._is_drawn & ~self._static_mask)
        self._textures.keep([item.texture_layer for item in items])
        table = self.__dict__.get("triangles")
        if table is not None and not table.append(self._store.ranges, self.indices):
            del self.triangles

    def instance_transforms(
        self, viewpoint_m: Floats, world_from_objects: Poses = ()
    ) -> InstanceTransforms:
        """Transforms of the items to the frame of a viewpoint (3,), world."""
        posed = self._world_transforms(world_from_objects)
        viewpoint_from_mesh = posed.viewpoint_from_mesh.copy()
        viewpoint_from_mesh[:, :3, 3] -= viewpoint_m  # in float64: precise far from the origin
        return posed._replace(
            viewpoint_from_mesh=viewpoint_from_mesh, centers_m=posed.centers_m - viewpoint_m
        )

    def _world_transforms(self, world_from_objects: Poses) -> InstanceTransforms:
        """Transforms of the items to the world, kept until objects move."""
        poses = np.array(world_from_objects)
        key = poses.tobytes()
        if self.deforming.size:
            key += np.float64(time_of(world_from_objects)).tobytes()
        if self._posed is not None and self._posed[0] == key:
            return self._posed[1]
        world_from_mesh, normal_from_mesh, centers_m = (
            transform.copy() for transform in self._rest_transforms
        )
        radii_m = self.radii_m
        if self.deforming.size:
            radii_m = radii_m.copy()
            time_s = time_of(world_from_objects)
            if self._deformed_spheres is None or self._deformed_spheres[0] != time_s:
                spheres = [self.draw_items[index].sphere_at(time_s) for index in self.deforming]
                centers = np.array([sphere.center for sphere in spheres])
                self._deformed_spheres = (
                    time_s,
                    centers,
                    np.array([sphere.radius for sphere in spheres]),
                )
            _, centers_m[self.deforming], radii_m[self.deforming] = self._deformed_spheres
        if self._dynamic.size:
            dynamic = self._dynamic
            world_from_object = poses[self._object_of_item[dynamic]]
            rotation = world_from_object[:, :3, :3]
            world_from_mesh[dynamic] = world_from_object @ world_from_mesh[dynamic]
            # a rotation equals its matrix of cofactors
            normal_from_mesh[dynamic] = rotation @ normal_from_mesh[dynamic]
            centers_m[dynamic] = (rotation @ centers_m[dynamic, :, None])[..., 0]
            centers_m[dynamic] += world_from_object[:, :3, 3]
        transforms = InstanceTransforms(world_from_mesh, normal_from_mesh, centers_m, radii_m)
        self._posed = key, transforms
        return transforms

    def deform(self, world_from_objects: Poses, *, triangles: bool = False) -> None:
        """Write deforming meshes for the time of the poses, and on request their triangles."""
        if not self.deforming.size:
            return
        if self._deformer is None:
            self.buffers_of(self.deforming)  # uploaded before they are deformed
            self._deformer = MeshDeformer(self.context, self._store.ranges)
        table = self.triangles if triangles else None
        self._deformer.run(time_of(world_from_objects), self._store.allocated[0], table)

    def showing(self, items: Indices, shot: ScenePoses) -> Iterator[int]:
        """Items, among indices (n,), that show something to a viewpoint, anywhere."""
        for index in items.tolist():
            item, place_m = self.draw_items[index], shot.viewpoint_m
            if item.object_index is not None:
                pose = shot.world_from_objects[item.object_index]
                place_m = (place_m - pose[:3, 3]) @ pose[:3, :3]
            if item.shows(place_m):
                yield index

    def front_to_back(self, items: Indices, transforms: InstanceTransforms) -> Indices:
        """Sort items (n,) front to back, those around the viewpoint last, to reduce overdraw."""
        far_m = np.linalg.norm(transforms.centers_m[items], axis=1) + transforms.radii_m[items]
        return items[np.argsort(far_m, kind="stable")]

    def shown(self, hidden: Collection[ObjectPart] = ()) -> Bools:
        """Mask (n,) of the items, without hidden parts of dynamic objects."""
        parts = [(item.object_index, item.name) for item in self.draw_items]
        return self._is_drawn & np.array([part not in hidden for part in parts], dtype=np.bool_)

    def shown_one_by_one(self, hidden: Collection[ObjectPart] = ()) -> Bools:
        """Mask (n,) of visible items outside of the clustered geometry."""
        return self.shown(hidden) & ~self._static_mask

    @property
    def _static_mask(self) -> Bools:
        """Mask (n,) of items inside the clustered geometry."""
        mask = np.zeros(len(self.draw_items), dtype=np.bool_)
        if self.clustered_geometry is not None:
            mask[: len(self.clustered_geometry.contains)] = self.clustered_geometry.contains
        return mask

    @cached_property
    def triangles(self) -> TriangleTable:
        """Corners of all triangles, for lookups."""
        return TriangleTable(self.context, self._store.ranges, self.indices)

    @cached_property
    def clustered_geometry(self) -> ClusteredGeometry | None:
        """Clusters of opaque and masked instances; None without any, or without multi-draws."""
        if not self._uses_clusters or not self.context.extensions >= _CALLS_OF_CLUSTERS:
            return None
        alone = {index for plane in self.mirrors for index in plane.parts}
        for place in self.reflectors.places[:MAX_PROBES]:
            alone |= place.surfaces
            if place.object_index is None:  # clusters leave parts of objects out
                alone |= place.left_out
        return build_clustered_geometry(
            self.context, self.draw_items, self._lighting, len(self._dynamic_objects), alone
        )

    def check_readable(self, purpose: str) -> None:
        """Refuse a scene that is too large for shaders to read its triangles.

        Raises:
            GraphicsError: names the size, the limit, and the purpose.
        """
        limit = MAX_WINDOWS * window_bytes(self.context)
        largest = max(self._store.sizes)
        if largest > limit:
            raise GraphicsError(
                f"the scene's triangles take {largest} bytes: this GPU allows {limit} {purpose}"
            )

    def sort_triangles(
        self, item: DrawItem, viewpoint_from_mesh: Floats, time_s: float = 0.0
    ) -> None:
        """Sort the indices of a blended item's triangles back to front.

        Args:
            item: blended item among those of `buffers_of`.
            viewpoint_from_mesh: (4, 4) transform from the mesh to the viewpoint frame.
            time_s: time for which a deforming mesh is sorted.
        """
        mesh = item.mesh
        centers = item.triangle_centers
        if mesh.deformation is not None:
            positions = mesh.deformation.positions_at(time_s)
            centers = positions[mesh.triangles].mean(axis=1, dtype=np.float64)
        centers = centers @ viewpoint_from_mesh[:3, :3].T + viewpoint_from_mesh[:3, 3]
        order = np.argsort(-np.sum(centers**2, axis=1), kind="stable")
        self._store.allocated[1].write(
            (mesh.triangles[order] + np.uint32(item.base)).astype("<u4"), offset=4 * item.first
        )


def _changed(
    scene: Scene, items: Sequence[DrawItem], static: Bools
) -> tuple[list[Instance], Bools]:
    """Instances without an item, and the mask (n,) of items without an instance."""
    unmatched: dict[tuple[object, ...], list[Instance]] = {}
    for instance in scene.instances:
        mesh = scene.meshes[instance.mesh]
        key = (instance.name, *geometry_key(mesh), id(scene.materials[mesh.material]))
        unmatched.setdefault((*key, id(instance.world_from_mesh)), []).append(instance)
    drawn = np.ones(len(items), dtype=np.bool_)
    # clustered items first: they are fastest to draw
    for index in np.argsort(~static, kind="stable").tolist():
        item = items[index]
        if item.object_index is None:
            key = (item.name, *geometry_key(item.mesh), id(item.material))
            same = unmatched.get((*key, id(item.object_from_mesh)))
            drawn[index] = bool(same)
            if same:
                same.pop()
    return [instance for same in unmatched.values() for instance in same], drawn


def make_draw_items(
    part: Scene,
    instances: Sequence[Instance],
    object_index: int | None,
    offsets: Sequence[tuple[int, int]],
    textures: MaterialTextures,
    is_baked: bool = False,
) -> list[DrawItem]:
    """Draw items of some instances of a scene, given first index and vertex of each."""
    if not instances:
        return []
    # all at once: one by one would take longer than the whole upload
    linear = np.array([instance.world_from_mesh[:3, :3] for instance in instances])
    flips_winding = np.linalg.det(linear) < 0.0
    cofactors = np.cross(linear[:, [1, 2, 0]], linear[:, [2, 0, 1]])
    cofactors[flips_winding] *= -1.0
    scales = np.linalg.norm(linear, 2, axis=(1, 2))
    items = []
    for number, (instance, (first, base)) in enumerate(zip(instances, offsets, strict=True)):
        mesh, object_from_mesh = part.meshes[instance.mesh], instance.world_from_mesh
        material = part.materials[mesh.material]
        low, high = bounds_of(mesh.positions)
        center = 0.5 * (low + high)
        radius = np.linalg.norm(mesh.positions - center, axis=1).max()
        light = LightSource.PROBES if is_baked else LightSource.COMPUTED
        rectangles: tuple[LightRectangle, ...] = ()
        has_places = mesh.light_coordinates is not None and object_index is None
        if is_baked and has_places and instance.light_rectangle is not None:
            light, front = LightSource.LIGHTMAP, instance.light_rectangle
            rectangles = front, instance.light_back_rectangle or front
        items.append(
            DrawItem(
                name=instance.name,
                object_index=object_index,
                mesh=mesh,
                first=first,
                count=mesh.triangles.size,
                base=base,
                material=material,
                texture_layer=textures.find(material, mesh),
                object_from_mesh=object_from_mesh,
                normal_from_mesh=cofactors[number],
                flips_winding=bool(flips_winding[number]),
                center_m=object_from_mesh[:3, :3] @ center + object_from_mesh[:3, 3],
                radius_m=float(radius) * float(scales[number]),
                light=light,
                light_rectangles=rectangles,
            )
        )
    return items
