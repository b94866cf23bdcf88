"""Hits of a picture's rays: triangle, point, range, normal and base colour; exact."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import moderngl
import numpy as np
from numpy.typing import NDArray

from omnisim.gpu.capture.pixel_map import RAYS_UNIT, PixelMap
from omnisim.gpu.capture.valid_pixels import valid_pixels_array
from omnisim.gpu.gl_functions import clear_integers
from omnisim.gpu.ground_truth.hit_tables import HitTables
from omnisim.gpu.ground_truth.visibility_pass import VisibilityPass
from omnisim.gpu.memory import gpu_allocation
from omnisim.gpu.shader_files import build_program
from omnisim.gpu.uniforms import columns_first, uniform
from omnisim.ground_truth.hits import Hits

_VERTICES, _INDICES = range(2)  # bindings
ALBEDO_UNIT = 4
_POINTS, _PRIMITIVES = range(2)  # attachments; normals and albedos follow


class _Variant(NamedTuple):
    """Program for some of the channels, and where it draws them."""

    target: moderngl.Framebuffer
    viewpoint_from_optical: moderngl.Uniform
    vertex_array: moderngl.VertexArray


class RayHitPass:
    """Intersects the rays of a picture with the visible triangles; everything is made once.

    Args:
        visibility: visible triangles.
        pixels: with the rays.

    Attributes:
        visibility, pixels: as given.
        points: texture of points and ranges, see `Hits`.
        primitives: texture of 1 + draw item, and triangle in it.
        tables: of the draw items.
        defines: of its programs.

    Raises:
        GraphicsError: a picture or a scene that does not fit on the GPU.
    """

    defines: tuple[str, ...] = ()

    def __init__(self, visibility: VisibilityPass, pixels: PixelMap):
        self.visibility, self.pixels = visibility, pixels
        visibility.buffers.check_readable("to look up what its pixels show")
        width, height = pixels.size_px
        self._what = f"ground truth of {width} × {height} px"
        with gpu_allocation(self._what, "make the picture smaller"):
            self._rays = pixels.rays
            self.points = pixels.context.texture(pixels.size_px, 4, dtype="f4")
            self.primitives = pixels.context.texture(pixels.size_px, 2, dtype="u4")
        for texture in (self.points, self.primitives):
            texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
        self._variants: dict[tuple[bool, bool], _Variant] = {}
        self.tables = HitTables(visibility)

    def refresh(self) -> None:
        """Hit what the buffers have now."""
        self.visibility.buffers.check_readable("to look up what its pixels show")
        self.visibility.refresh()
        self.tables.refresh()

    def render(
        self,
        world_from_rig: NDArray[np.float64],
        world_from_objects: Sequence[NDArray[np.float64]] = (),
        normals: bool = False,
        albedos: bool = False,
    ) -> Hits:
        """Intersect all rays from a pose (4, 4), dynamic objects at theirs.

        Normals and albedos have no rows where they are not asked for; albedos need a `visibility`
        with some.
        """
        visibility, buffers = self.visibility, self.visibility.buffers
        transforms = buffers.instance_transforms(world_from_rig[:3, 3], world_from_objects)
        visibility.render(world_from_rig, world_from_objects, albedos)
        if (normals, albedos) not in self._variants:
            self._variants[normals, albedos] = self._variant(normals, albedos)
        variant = self._variants[normals, albedos]
        viewpoint_from_optical = world_from_rig[:3, :3] @ self.pixels.camera.rig_from_optical
        variant.viewpoint_from_optical.write(columns_first(viewpoint_from_optical))
        variant.target.use()
        self.tables.update(transforms, transforms.normal_from_mesh)
        self.bind()
        if albedos and visibility.albedo_atlas is not None:
            visibility.albedo_atlas.use(ALBEDO_UNIT)
        self.bind_geometry()
        variant.vertex_array.render()
        return read_hits(variant.target, self.pixels.size_px, 1, normals, albedos)[0]

    def bind_geometry(self) -> None:
        """Bind vertices and indices, which normals need."""
        buffers = self.visibility.buffers
        buffers.vertices.bind_to_storage_buffer(_VERTICES)
        buffers.triangles.indices.bind_to_storage_buffer(_INDICES)

    def bind(self) -> None:
        """Bind the rays."""
        self._rays.use(RAYS_UNIT)

    def prepare(self, program: moderngl.Program, rig_from_optical: NDArray[np.float64]) -> None:
        """Set the constant uniforms of a program, with rig_from_optical (3, 3)."""
        self.tables.bind_program(program, rig_from_optical)
        uniform(program, "u_rays").value = RAYS_UNIT

    def _variant(self, normals: bool, albedos: bool) -> _Variant:
        context = self.pixels.context
        program = self.build_program(normals, albedos)
        with gpu_allocation(self._what, "make the picture smaller"):
            target = hits_target(
                context, self.pixels.size_px, [self.points, self.primitives], normals, albedos
            )
        array = valid_pixels_array(context, program, self.pixels.valid)
        return _Variant(target, uniform(program, "u_viewpoint_from_optical"), array)

    def build_program(self, normals: bool, albedos: bool, *defines: str) -> moderngl.Program:
        """Program of the hits, its constant uniforms set."""
        program = build_program(
            self.pixels.context,
            "capture/picture.vert",
            "ground_truth/hits.frag",
            (
                *self.defines,
                *(("NORMALS",) if normals else ()),
                *(("ALBEDO",) if albedos else ()),
                *defines,
            ),
        )
        self.prepare(program, self.pixels.camera.rig_from_optical)
        if albedos:
            uniform(program, "u_albedos").value = ALBEDO_UNIT
        return program


def hits_target(
    context: moderngl.Context,
    size: tuple[int, int],
    points_and_primitives: Sequence[moderngl.Texture | moderngl.Renderbuffer],
    normals: bool,
    albedos: bool,
) -> moderngl.Framebuffer:
    """Target of the hits, without any: nothing is ever drawn where there is no ray."""
    attachments = list(points_and_primitives)
    if normals:
        attachments.append(context.renderbuffer(size, 4, dtype="f4"))
    if albedos:
        attachments.append(context.renderbuffer(size, 4, dtype="f2"))
    target = context.framebuffer(attachments)
    target.use()
    target.clear(0.0, 0.0, 0.0, np.inf)
    clear_integers(_PRIMITIVES)
    return target


def read_hits(
    target: moderngl.Framebuffer, size_px: tuple[int, int], count: int, normals: bool, albedos: bool
) -> list[Hits]:
    """Read the hits of some pictures, of width and height, that are below each other."""
    width, height = size_px
    region = (0, 0, width, count * height)
    points = np.empty((count, height, width, 4), dtype=np.float32)
    primitives = np.empty((count, height, width, 2), dtype=np.uint32)
    target.read_into(points, region, components=4, attachment=_POINTS, dtype="f4")
    target.read_into(primitives, region, components=2, attachment=_PRIMITIVES, dtype="u4")
    channels = []
    attachment = _PRIMITIVES
    for is_asked_for in (normals, albedos):
        channel = np.empty((count, height if is_asked_for else 0, width, 3), dtype=np.float32)
        if is_asked_for:
            attachment += 1
            target.read_into(channel, region, components=3, attachment=attachment, dtype="f4")
        channels.append(channel)
    arrays = (points, primitives[..., 0], primitives[..., 1], *channels)
    return [Hits(*(values[one] for values in arrays)) for one in range(count)]
