"""What the rays of a picture hit: which triangle, how far, and how it is turned; exactly."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import moderngl
import numpy as np
from numpy.typing import NDArray

from omnisim.errors import GraphicsError
from omnisim.gpu.capture.capture_pass import connect_cube
from omnisim.gpu.capture.ray_table import RayTable
from omnisim.gpu.gl_functions import clear_integers
from omnisim.gpu.ground_truth.hit_tables import (
    DrawItemTable,
    connect_places,
    connect_tables,
    use_tables,
)
from omnisim.gpu.ground_truth.visibility_pass import VisibilityPass
from omnisim.gpu.shader_files import build_program
from omnisim.gpu.uniforms import columns_first

_VERTICES, _INDICES = range(2)  # bindings
_RAYS, _ALBEDO_ATLAS, _PLACES = 1, 4, 5  # texture units
_HITS, _SURFACES = range(2)  # attachments; normals and plain colours follow


class Surfaces(NamedTuple):
    """What each pixel's ray hits; first row at the top.

    "Here" has the world's axes and its origin in the effective viewpoint.
    """

    hits: NDArray[np.float32]  # (height, width, 4), the points and ranges below
    draws_plus_one: NDArray[np.uint32]  # (height, width), 1 + number of the draw; 0: nothing is hit
    normals: NDArray[np.float32] | None  # (height, width, 3), here, unit; 0: nothing is hit
    albedos: NDArray[np.float32] | None  # (height, width, 3) linear RGB; 0: nothing is hit

    @property
    def points_m(self) -> NDArray[np.float32]:
        """Points (height, width, 3), here; where nothing is hit, directions."""
        return self.hits[..., :3]

    @property
    def ranges_m(self) -> NDArray[np.float32]:
        """Ranges (height, width); +inf: nothing is hit."""
        return self.hits[..., 3]


class _Lookup(NamedTuple):
    """What looks rays up, for what is asked for."""

    target: moderngl.Framebuffer
    viewpoint_from_optical: moderngl.Uniform
    vertex_array: moderngl.VertexArray | None


class RayHitPass:
    """Looks the rays of a picture up in the visible triangles; everything is made once.

    Args:
        context: where.
        visibility: which triangles are visible.
        rays: of the pixels.
        rig_from_optical: (3, 3).

    Attributes:
        hits: texture; where each ray hits, here, and the range; see `Surfaces`.
        surfaces: texture; 1 + number of the draw, and number of its triangle.

    Raises:
        GraphicsError: a picture or a scene that does not fit on the GPU.
    """

    def __init__(
        self,
        context: moderngl.Context,
        visibility: VisibilityPass,
        rays: RayTable,
        rig_from_optical: NDArray[np.float64],
    ):
        self._visibility, self._rays = visibility, rays
        self._context, self._rig_from_optical = context, rig_from_optical
        visibility.buffers.check_readable("to look up what its pixels show")
        size = rays.size
        try:
            self.hits = context.texture(size, 4, dtype="f4")
            self.surfaces = context.texture(size, 2, dtype="u4")
            self._places = context.texture(size, 4, dtype="f4")
        except moderngl.Error as reason:
            raise _too_large(size, reason) from None
        for texture in (self.hits, self.surfaces, self._places):
            texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
        self._find_places()
        self._lookups: dict[tuple[bool, bool], _Lookup] = {}
        self._draws = DrawItemTable(context, visibility.buffers.draw_items)

    def render(
        self,
        world_from_rig: NDArray[np.float64],
        world_from_objects: Sequence[NDArray[np.float64]] = (),
        normals: bool = False,
        albedos: bool = False,
    ) -> Surfaces:
        """Look up all rays up from a pose (4, 4), dynamic objects at theirs.

        The last two are made where they are asked for; plain colours only where the visibility can
        have some.
        """
        visibility, buffers = self._visibility, self._visibility.buffers
        placement = buffers.instance_transforms(world_from_rig[:3, 3], world_from_objects)
        visibility.render(world_from_rig, placement, albedos)
        self._draws.write(placement, placement.normal_from_mesh)
        viewpoint_from_optical = world_from_rig[:3, :3] @ self._rig_from_optical
        lookup = self._lookup(normals, albedos)
        lookup.viewpoint_from_optical.write(columns_first(viewpoint_from_optical))
        lookup.target.use()
        use_tables(visibility, self._draws)
        self._rays.rays.use(_RAYS)
        self._places.use(_PLACES)
        if albedos:
            visibility.albedo_atlas.use(_ALBEDO_ATLAS)
        buffers.vertices.bind_to_storage_buffer(_VERTICES)
        buffers.triangles.indices.bind_to_storage_buffer(_INDICES)
        if lookup.vertex_array is not None:
            lookup.vertex_array.render(moderngl.TRIANGLES)
        return self._read(lookup.target, normals, albedos)

    def _lookup(self, normals: bool, albedos: bool) -> _Lookup:
        """What looks up what is asked for: made when it is first asked for."""
        if (normals, albedos) not in self._lookups:
            self._lookups[normals, albedos] = self._make_lookup(normals, albedos)
        return self._lookups[normals, albedos]

    def _make_lookup(self, normals: bool, albedos: bool) -> _Lookup:
        context, size = self._context, self._rays.size
        program = build_program(
            context,
            "capture/picture.vert",
            "ground_truth/surfaces.frag",
            (*(("NORMALS",) if normals else ()), *(("ALBEDO",) if albedos else ())),
        )
        connect_tables(program, self._visibility)
        program["u_rays"] = _RAYS
        program["u_places"] = _PLACES
        if albedos:
            program["u_albedos"] = _ALBEDO_ATLAS
        try:
            attachments: list[moderngl.Texture | moderngl.Renderbuffer] = [self.hits, self.surfaces]
            if normals:
                attachments.append(context.renderbuffer(size, 4, dtype="f4"))
            if albedos:
                attachments.append(context.renderbuffer(size, 4, dtype="f2"))
            target = context.framebuffer(attachments)
        except moderngl.Error as reason:
            raise _too_large(size, reason) from None
        # once: nothing is ever drawn where there is no ray
        target.use()
        target.clear(0.0, 0.0, 0.0, np.inf)
        clear_integers(_SURFACES)
        vertex_array = self._rays.vertex_array(program)
        return _Lookup(target, program["u_viewpoint_from_optical"], vertex_array)

    def _find_places(self) -> None:
        """Find where in the atlas the rays look: once, as no pose changes it."""
        files = "capture/picture.vert", "ground_truth/places.frag"
        program = build_program(self._context, *files)
        connect_cube(program, self._visibility.plan, self._rig_from_optical)
        connect_places(program, self._visibility)
        program["u_rays"] = _RAYS
        draws = self._rays.vertex_array(program)
        self._context.framebuffer([self._places]).use()
        self._rays.rays.use(_RAYS)
        if draws is not None:
            draws.render(moderngl.TRIANGLES)

    def _read(self, target: moderngl.Framebuffer, normals: bool, albedos: bool) -> Surfaces:
        width, height = self._rays.size
        hits = np.empty((height, width, 4), dtype=np.float32)
        surfaces = np.empty((height, width, 2), dtype=np.uint32)
        target.read_into(hits, components=4, attachment=_HITS, dtype="f4")
        target.read_into(surfaces, components=2, attachment=_SURFACES, dtype="u4")
        extra: list[NDArray[np.float32] | None] = []
        attachment = _SURFACES
        for is_asked_for in (normals, albedos):
            extra.append(np.empty((height, width, 3), np.float32) if is_asked_for else None)
            if is_asked_for:
                attachment += 1
                target.read_into(extra[-1], components=3, attachment=attachment, dtype="f4")
        return Surfaces(hits, surfaces[..., 0], *extra)


def _too_large(size: tuple[int, int], reason: moderngl.Error) -> GraphicsError:
    return GraphicsError(
        f"ground truth of {size[0]} × {size[1]} px does not fit on this GPU ({reason}): "
        "make the picture smaller"
    )
