"""A scene and its dynamic objects on the GPU: one vertex buffer, one index buffer, textures, draws.

A dynamic object is a scene in a frame of its own, with a pose in the world that may change in
each frame. Its geometry stays where it is; only matrices change.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import moderngl
import numpy as np
from numpy.typing import NDArray

from omnisim.errors import GraphicsError, SceneError
from omnisim.gpu.ground_truth.triangle_table import TriangleTable
from omnisim.gpu.scene.masked_mipmaps import masked_mipmaps
from omnisim.gpu.scene.mipmaps import SRGB8_ALPHA8, mipmaps, upload_levels
from omnisim.gpu.scene.static_geometry import StaticGeometry
from omnisim.gpu.scene.vertex_format import VERTEX, fill_vertices, vertex_array
from omnisim.scene.model import AlphaMode, Instance, Material, Mesh, Scene, Wrap


@dataclass(frozen=True, eq=False)
class DrawItem:
    """One instance of one mesh, ready to draw.

    Attributes:
        name: of the instance.
        object_index: dynamic object that it belongs to; None: it is static.
        mesh: its mesh.
        first, count: its indices in the index buffer.
        base: first vertex of its mesh in the vertex buffer.
        material: how it looks.
        texture: bound for it.
        object_from_mesh: (4, 4) float64, into the world or the object's frame.
        normal_from_mesh: (3, 3) cofactors of its linear part, signed so that normals stay outside.
        flips_winding: its triangles are wound the other way round in the world.
        centre_m, radius_m: its bounding sphere in the world or the object's frame.
    """

    name: str
    object_index: int | None
    mesh: Mesh
    first: int
    count: int
    base: int
    material: Material
    texture: moderngl.Texture
    object_from_mesh: NDArray[np.float64]
    normal_from_mesh: NDArray[np.float64]
    flips_winding: bool
    centre_m: NDArray[np.float64]
    radius_m: float


class InstanceTransforms(NamedTuple):
    """Where the draws are in one frame, in the axes of the world.

    Attributes:
        viewpoint_from_mesh: (n, 4, 4); origin at the viewpoint.
        normal_from_mesh: (n, 3, 3), see `DrawItem`.
        centres_m: (n, 3) of the bounding spheres, from the viewpoint.
    """

    viewpoint_from_mesh: NDArray[np.float64]
    normal_from_mesh: NDArray[np.float64]
    centres_m: NDArray[np.float64]


class _Shape(NamedTuple):
    """What the linear part of a pose does.

    Attributes:
        normal_from_mesh: (3, 3) for directions at right angles to surfaces.
        mirrored: whether it turns left into right.
        stretch: by how much it lengthens what it lengthens most.
    """

    normal_from_mesh: NDArray[np.float64]
    mirrored: bool
    stretch: float


def _shapes(instances: Sequence[Instance]) -> list[_Shape]:
    """All at once: one by one they take longer than the whole upload."""
    if not instances:
        return []
    linear = np.array([instance.world_from_mesh[:3, :3] for instance in instances])
    mirrored = np.linalg.det(linear) < 0.0
    cofactors = np.cross(linear[:, [1, 2, 0]], linear[:, [2, 0, 1]])
    cofactors[mirrored] *= -1.0
    stretch = np.linalg.norm(linear, 2, axis=(1, 2))
    return list(map(_Shape, cofactors, mirrored.tolist(), stretch.tolist()))


class SceneBuffers:
    """Uploads a scene and its dynamic objects once; the passes of all sensors draw from it.

    Args:
        context: where.
        scene: what stands in the world.
        dynamic_objects: those in it; their lamps, backgrounds and starts count for nothing.

    Attributes:
        vertices, indices: the two buffers.
        draws: opaque and masked instances, then blended ones; within each by material.
        radii_m: (n,) of the draws' bounding spheres.

    Raises:
        GraphicsError: a texture past the limits of the GPU.
    """

    def __init__(
        self, context: moderngl.Context, scene: Scene, dynamic_objects: Sequence[Scene] = ()
    ):
        self._context, self._lighting = context, scene.lighting
        self._textures: dict[tuple[int, float | None], moderngl.Texture] = {}
        self._white = self._upload_pixels(np.full((1, 1, 4), 255, dtype=np.uint8))
        parts = (scene, *dynamic_objects)
        draws = [
            self._draw(part, instance, None if number == 0 else number - 1, place, shape)
            for number, (part, places) in enumerate(
                zip(parts, self._upload_meshes(parts), strict=True)
            )
            for instance, place, shape in zip(
                part.instances, places, _shapes(part.instances), strict=True
            )
        ]
        materials = [material for part in parts for material in part.materials]
        rank = {id(material): rank for rank, material in enumerate(materials)}
        draws.sort(key=lambda draw: (is_blended(draw.material), rank[id(draw.material)]))
        self.draw_items = tuple(draws)
        self.radii_m = np.array([draw.radius_m for draw in draws])
        self._own = (
            np.array([draw.object_from_mesh for draw in draws]),
            np.array([draw.normal_from_mesh for draw in draws]),
            np.array([draw.centre_m for draw in draws]),
        )
        moving = [index for index, draw in enumerate(draws) if draw.object_index is not None]
        self._moving = np.array(moving, dtype=np.intp)
        self._object_of_moving = np.array(
            [draws[index].object_index for index in moving], dtype=np.intp
        )

    @property
    def context(self) -> moderngl.Context:
        """The OpenGL context that holds it."""
        return self._context

    def instance_transforms(
        self,
        viewpoint_m: NDArray[np.float64],
        world_from_objects: Sequence[NDArray[np.float64]] = (),
    ) -> InstanceTransforms:
        """Where the draws are, seen from (3,), world, each dynamic object at its pose (4, 4)."""
        world_from_mesh, normal_from_mesh, centres_m = (values.copy() for values in self._own)
        if self._moving.size:
            moving = self._moving
            world_from_own = np.stack(world_from_objects)[self._object_of_moving]
            turn = world_from_own[:, :3, :3]
            world_from_mesh[moving] = world_from_own @ world_from_mesh[moving]
            # a rotation is its own matrix of cofactors
            normal_from_mesh[moving] = turn @ normal_from_mesh[moving]
            centres_m[moving] = (turn @ centres_m[moving, :, None])[..., 0]
            centres_m[moving] += world_from_own[:, :3, 3]
        world_from_mesh[:, :3, 3] -= viewpoint_m  # in float64: far from the origin counts too
        return InstanceTransforms(world_from_mesh, normal_from_mesh, centres_m - viewpoint_m)

    def front_to_back(
        self, draws: NDArray[np.intp], placement: InstanceTransforms
    ) -> NDArray[np.intp]:
        """Draws (n,), near ones first and what surrounds them all last: little is painted twice."""
        reach_m = np.linalg.norm(placement.centres_m[draws], axis=1) + self.radii_m[draws]
        return draws[np.argsort(reach_m, kind="stable")]

    def shown(self, hidden: Collection[str] = ()) -> NDArray[np.bool_]:
        """Which draws (n,) are left without the dynamic objects' instances of these names.

        Raises:
            SceneError: a name that no dynamic object has.
        """
        names = {draw.name for draw in self.draw_items if draw.object_index is not None}
        for name in sorted(hidden):
            if name not in names:
                there = f"it has {', '.join(sorted(names))}" if names else "there is no body"
                raise SceneError(f"hidden: {name!r}: no part of the body: {there}")
        return np.array(
            [draw.object_index is None or draw.name not in hidden for draw in self.draw_items]
        )

    @cached_property
    def triangles(self) -> TriangleTable:
        """All triangles a second time: as one looks up single ones."""
        return TriangleTable(self)

    @cached_property
    def static_geometry(self) -> StaticGeometry:
        """What does not move, a second time: as one draws much of it quickly."""
        return StaticGeometry(self._context, self.draw_items, self._lighting)

    def check_readable(self, purpose: str) -> None:
        """Refuse a scene whose triangles shaders cannot read.

        Raises:
            GraphicsError: naming the size, the limit, and the purpose.
        """
        limit = int(self._context.info["GL_MAX_SHADER_STORAGE_BLOCK_SIZE"])
        largest = max(self.vertices.size, self.indices.size)
        if largest > limit:
            raise GraphicsError(
                f"the scene's triangles take {largest} bytes: {purpose} this GPU allows {limit}"
            )

    def vertex_array(self, program: moderngl.Program) -> moderngl.VertexArray:
        """The vertex array that feeds a program; attributes it does not use are skipped."""
        return vertex_array(self._context, program, self.vertices, self.indices)

    def sort_blended(self, draw: DrawItem, viewpoint_from_mesh: NDArray[np.float64]) -> None:
        """Put the triangles of a blended draw into the index buffer from far to near.

        Args:
            draw: which.
            viewpoint_from_mesh: (4, 4), to where the origin is the viewpoint.
        """
        mesh = draw.mesh
        centres = mesh.positions[mesh.triangles].mean(axis=1, dtype=np.float64)
        here = centres @ viewpoint_from_mesh[:3, :3].T + viewpoint_from_mesh[:3, 3]
        order = np.argsort(-np.sum(here**2, axis=1), kind="stable")
        self.indices.write(
            (mesh.triangles[order] + np.uint32(draw.base)).astype("<u4"), offset=4 * draw.first
        )

    def _upload_meshes(self, parts: Sequence[Scene]) -> list[list[tuple[int, int]]]:
        """Fill the buffers; return for each part, for each of its instances, the first index and
        the first vertex of its mesh.

        Instances of a mesh share its indices, but blended ones, whose order is their own.
        """
        count = sum(len(mesh.positions) for part in parts for mesh in part.meshes)
        vertices = np.zeros(count, dtype=VERTEX)
        indices: list[NDArray[np.uint32]] = []
        places: list[list[tuple[int, int]]] = []
        base = first = 0
        for part in parts:
            bases = []
            for mesh in part.meshes:
                fill_vertices(vertices[base : base + len(mesh.positions)], mesh)
                bases.append(base)
                base += len(mesh.positions)
            shared: dict[int, int] = {}
            places.append([])
            for instance in part.instances:
                mesh = part.meshes[instance.mesh]
                own = is_blended(part.materials[mesh.material])
                if own or instance.mesh not in shared:
                    indices.append(mesh.triangles.ravel() + np.uint32(bases[instance.mesh]))
                    shared[instance.mesh] = first
                    first += mesh.triangles.size
                places[-1].append((shared[instance.mesh], bases[instance.mesh]))
        self.vertices = self._context.buffer(vertices)
        self.indices = self._context.buffer(np.concatenate(indices).astype("<u4"))
        return places

    def _draw(
        self,
        part: Scene,
        instance: Instance,
        object_index: int | None,
        place: tuple[int, int],
        shape: _Shape,
    ) -> DrawItem:
        mesh = part.meshes[instance.mesh]
        material = part.materials[mesh.material]
        middle = 0.5 * (mesh.positions.min(axis=0) + mesh.positions.max(axis=0))
        reach = np.linalg.norm(mesh.positions - middle, axis=1).max()
        return DrawItem(
            name=instance.name,
            object_index=object_index,
            mesh=mesh,
            first=place[0],
            base=place[1],
            count=mesh.triangles.size,
            material=material,
            texture=self._texture(material, mesh),
            object_from_mesh=instance.world_from_mesh,
            normal_from_mesh=shape.normal_from_mesh,
            flips_winding=shape.mirrored,
            centre_m=instance.world_from_mesh[:3, :3] @ middle + instance.world_from_mesh[:3, 3],
            radius_m=float(reach) * shape.stretch,
        )

    def _texture(self, material: Material, mesh: Mesh) -> moderngl.Texture:
        texture = material.texture
        if texture is None or mesh.texture_coordinates is None:
            return self._white
        cutoff = material.alpha_cutoff if material.alpha_mode is AlphaMode.MASK else None
        key = (id(texture), cutoff)
        if key not in self._textures:
            uploaded = self._upload_pixels(texture.pixels, cutoff, f" of {material.name!r}")
            uploaded.repeat_x = texture.wrap_u is not Wrap.CLAMP_TO_EDGE
            uploaded.repeat_y = texture.wrap_v is not Wrap.CLAMP_TO_EDGE
            self._textures[key] = uploaded
        return self._textures[key]

    def _upload_pixels(
        self, pixels: NDArray[np.uint8], cutoff: float | None = None, used_by: str = ""
    ) -> moderngl.Texture:
        height, width = pixels.shape[:2]
        limit = int(self._context.info["GL_MAX_TEXTURE_SIZE"])
        if max(height, width) > limit:
            raise GraphicsError(
                f"a texture{used_by} has {width} × {height} texels: this GPU takes at most {limit}"
            )
        texture = self._context.texture(
            (width, height), 4, np.ascontiguousarray(pixels), internal_format=SRGB8_ALPHA8
        )
        levels = mipmaps(pixels) if cutoff is None else masked_mipmaps(pixels, cutoff)
        upload_levels(texture, levels)
        texture.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
        return texture


def is_blended(material: Material) -> bool:
    """Whether what is behind the material shines through."""
    return material.alpha_mode is AlphaMode.BLEND
