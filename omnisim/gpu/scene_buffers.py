"""The scene on the GPU: one vertex buffer, one index buffer, textures, and a list of draws."""

from __future__ import annotations

from dataclasses import dataclass

import moderngl
import numpy as np
from numpy.typing import NDArray

from omnisim.errors import GraphicsError
from omnisim.gpu.masked_mipmaps import masked_mipmaps
from omnisim.scene.model import AlphaMode, Material, Mesh, Scene, Wrap

_VERTEX = np.dtype(  # read word by word in shaders/scene/range.comp
    [
        ("in_position", "<f4", 3),
        ("in_normal", "<f4", 3),  # zero: flat, the triangle's own
        ("in_texture_coordinate", "<f4", 2),
        ("in_color", "<f2", 4),
    ]
)
_SRGB8_ALPHA8 = 0x8C43


@dataclass(frozen=True, eq=False)
class Draw:
    """One instance of one mesh, ready to draw.

    Attributes:
        mesh: its mesh.
        first, count: its indices in the index buffer.
        base: first vertex of its mesh in the vertex buffer.
        material: how it looks.
        texture: bound for it.
        world_from_mesh: (4, 4) float64.
        normal_from_mesh: (3, 3) cofactors of its linear part, signed so that normals stay outside.
        mirrored: its triangles turn the other way round in the world.
        centre_m, radius_m: its bounding sphere in the world.
    """

    mesh: Mesh
    first: int
    count: int
    base: int
    material: Material
    texture: moderngl.Texture
    world_from_mesh: NDArray[np.float64]
    normal_from_mesh: NDArray[np.float64]
    mirrored: bool
    centre_m: NDArray[np.float64]
    radius_m: float


class SceneBuffers:
    """Uploads a scene once; the passes draw from it.

    Attributes:
        vertices, indices: the two buffers.
        draws: opaque and masked instances, then blended ones; within each by material.
        centres_m: (n, 3) and radii_m: (n,) of the draws' bounding spheres.
        world_from_mesh: (n, 4, 4) of the draws.

    Raises:
        GraphicsError: a texture past the limits of the GPU.
    """

    def __init__(self, context: moderngl.Context, scene: Scene):
        self._context = context
        self._textures: dict[tuple[int, float | None], moderngl.Texture] = {}
        self._white = self._upload_pixels(np.full((1, 1, 4), 255, dtype=np.uint8))
        firsts, bases = self._upload_meshes(scene)
        draws = [
            self._draw(scene, index, firsts[index], bases[scene.instances[index].mesh])
            for index in range(len(scene.instances))
        ]
        rank = {id(material): rank for rank, material in enumerate(scene.materials)}
        draws.sort(key=lambda draw: (is_blended(draw.material), rank[id(draw.material)]))
        self.draws = tuple(draws)
        self.centres_m = np.array([draw.centre_m for draw in draws])
        self.radii_m = np.array([draw.radius_m for draw in draws])
        self.world_from_mesh = np.array([draw.world_from_mesh for draw in draws])

    @property
    def context(self) -> moderngl.Context:
        """The OpenGL context that holds it."""
        return self._context

    def vertex_array(self, program: moderngl.Program) -> moderngl.VertexArray:
        """The vertex array that feeds a program; attributes it does not use are skipped."""
        formats = {3: "3f4", 2: "2f4", 4: "4f2"}
        layout, names = [], []
        for name in _VERTEX.names:
            kind, _ = _VERTEX.fields[name]
            if name in program:
                layout.append(formats[kind.shape[0]])
                names.append(name)
            else:
                layout.append(f"{kind.itemsize}x")
        content = [(self.vertices, " ".join(layout), *names)]
        return self._context.vertex_array(program, content, self.indices, index_element_size=4)

    def sort_blended(self, draw: Draw, viewpoint_m: NDArray[np.float64]) -> None:
        """Put the triangles of a blended draw into the index buffer from far to near."""
        mesh = draw.mesh
        centres = mesh.positions[mesh.triangles].mean(axis=1, dtype=np.float64)
        world = centres @ draw.world_from_mesh[:3, :3].T + draw.world_from_mesh[:3, 3]
        order = np.argsort(-np.sum((world - viewpoint_m) ** 2, axis=1), kind="stable")
        self.indices.write(
            (mesh.triangles[order] + np.uint32(draw.base)).astype("<u4"), offset=4 * draw.first
        )

    def _upload_meshes(self, scene: Scene) -> tuple[list[int], list[int]]:
        """Fill the buffers; return the first index of each instance, first vertex of each mesh.

        Instances of a mesh share its indices, but blended ones, whose order is their own.
        """
        vertices = np.zeros(sum(len(mesh.positions) for mesh in scene.meshes), dtype=_VERTEX)
        bases, base = [], 0
        for mesh in scene.meshes:
            part = vertices[base : base + len(mesh.positions)]
            part["in_position"] = mesh.positions
            part["in_color"] = 1.0
            if mesh.normals is not None:
                part["in_normal"] = mesh.normals
            if mesh.texture_coordinates is not None:
                part["in_texture_coordinate"] = mesh.texture_coordinates
            if mesh.colors is not None:
                part["in_color"] = mesh.colors
            bases.append(base)
            base += len(mesh.positions)
        parts, firsts, first = [], [], 0
        shared: dict[int, int] = {}
        for instance in scene.instances:
            mesh = scene.meshes[instance.mesh]
            own = is_blended(scene.materials[mesh.material])
            if own or instance.mesh not in shared:
                parts.append(mesh.triangles.ravel() + np.uint32(bases[instance.mesh]))
                shared[instance.mesh] = first
                first += mesh.triangles.size
            firsts.append(shared[instance.mesh])
        self.vertices = self._context.buffer(vertices)
        self.indices = self._context.buffer(np.concatenate(parts).astype("<u4"))
        return firsts, bases

    def _draw(self, scene: Scene, index: int, first: int, base: int) -> Draw:
        instance = scene.instances[index]
        mesh = scene.meshes[instance.mesh]
        material = scene.materials[mesh.material]
        linear = instance.world_from_mesh[:3, :3]
        mirrored = bool(np.linalg.det(linear) < 0.0)
        cofactors = np.array([np.cross(linear[(i + 1) % 3], linear[(i + 2) % 3]) for i in range(3)])
        middle = 0.5 * (mesh.positions.min(axis=0) + mesh.positions.max(axis=0))
        reach = np.linalg.norm(mesh.positions - middle, axis=1).max()
        return Draw(
            mesh=mesh,
            first=first,
            base=base,
            count=mesh.triangles.size,
            material=material,
            texture=self._texture(material, mesh),
            world_from_mesh=instance.world_from_mesh,
            normal_from_mesh=-cofactors if mirrored else cofactors,
            mirrored=mirrored,
            centre_m=linear @ middle + instance.world_from_mesh[:3, 3],
            radius_m=float(reach) * float(np.linalg.norm(linear, 2)),
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
            (width, height), 4, np.ascontiguousarray(pixels), internal_format=_SRGB8_ALPHA8
        )
        texture.build_mipmaps()
        if cutoff is not None:
            for level, level_pixels in enumerate(masked_mipmaps(pixels, cutoff), start=1):
                texture.write(level_pixels.tobytes(), level=level)
        texture.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
        return texture


def is_blended(material: Material) -> bool:
    """Whether what is behind the material shines through."""
    return material.alpha_mode is AlphaMode.BLEND
