"""Exact hits of an image's rays: triangle, point, range and surface details."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, ClassVar, NamedTuple

import moderngl
import numpy as np
from numpy.typing import NDArray

from omnisim.core.arrays import Floats
from omnisim.core.pending import Pending
from omnisim.ground_truth.hits import NO_DETAILS, HitDetails, Hits
from omnisim.rendering.opengl.atlas.image_parts import ImagePart
from omnisim.rendering.opengl.capture.pixel_map import (
    RAYS_UNIT,
    PixelMap,
    bind_tiles,
    valid_pixels_array,
)
from omnisim.rendering.opengl.gl.framebuffers import clear_target, framebuffer, within
from omnisim.rendering.opengl.gl.gpu_textures import renderbuffer, texture_2d
from omnisim.rendering.opengl.gl.memory import gpu_allocation
from omnisim.rendering.opengl.gl.pixel_readback import PixelReadback, Pixels, Read
from omnisim.rendering.opengl.gl.shader_files import build_program, columns_first, uniform
from omnisim.rendering.opengl.hits.hit_tables import HitTables
from omnisim.rendering.opengl.hits.visibility_pass import VisibilityPass, atlas_formats
from omnisim.rendering.opengl.world.triangle_table import bind_triangles, window_defines

DETAIL_UNITS = {"u_albedos": 4, "u_gloss": 5, "u_emission": 7}
_PRIMITIVES = 1  # attachment, after the points; details follow
# Define and attachment components of each detail.
_DEFINES = {"normals": "NORMALS", "albedos": "ALBEDO", "materials": "MATERIALS"}
_PARTS = {"normals": (3,), "albedos": (3,), "materials": (2, 3)}


class _Variant(NamedTuple):
    """Program for a set of channels, and its target."""

    target: moderngl.Framebuffer
    viewpoint_from_optical: moderngl.Uniform
    vertex_array: moderngl.VertexArray


class RayHitPass:
    """Intersects an image's rays with the visible triangles; GPU resources are created once.

    Args:
        visibility: pass that draws the triangle IDs.
        pixels: rays of the pixels.
        parts: parts of the image, drawn one after the other; by default a single one.

    Attributes:
        visibility, pixels, parts: see the arguments.
        points: texture of points and ranges, see `Hits`.
        primitives: texture of 1 + draw item, and triangle in the item.
        tables: tables of the draw items.
        readback: ring of its readbacks.
        shader: fragment shader of hits.
        occlusion_shader: fragment shader of their occlusion from another viewpoint.

    Raises:
        GraphicsError: an image or a scene that does not fit on the GPU.
    """

    shader: ClassVar[str] = "ground_truth/hits.frag"
    occlusion_shader: ClassVar[str] = "ground_truth/occlusion.frag"

    def __init__(
        self, visibility: VisibilityPass, pixels: PixelMap, parts: Sequence[ImagePart] | None = None
    ):
        self.visibility, self.pixels = visibility, pixels
        visibility.buffers.check_readable("to look up what its pixels show")
        width, height = pixels.size_px
        self.parts = parts or [ImagePart((0, 0, width, height), visibility.plan)]
        self._what = f"ground truth of {width} × {height} px"
        with gpu_allocation(self._what, "make the image smaller"):
            self._rays = pixels.rays
            self.points = texture_2d(pixels.context, pixels.size_px, 4)
            self.primitives = texture_2d(pixels.context, pixels.size_px, 2, dtype="u4")
        self._variants: dict[HitDetails, _Variant] = {}
        self.tables = HitTables(visibility)
        self.readback = PixelReadback(pixels.context)
        self._compiled_windows = self._windows()

    def _windows(self) -> tuple[str, ...]:
        buffers = self.visibility.buffers
        return window_defines(buffers.context, buffers.vertices, buffers.indices)

    def refresh(self) -> None:
        """Update after the buffers changed."""
        self.visibility.buffers.check_readable("to look up what its pixels show")
        if self._windows() != self._compiled_windows:
            self._compiled_windows = self._windows()
            self._variants = {}
        self.visibility.refresh()
        self.tables.refresh()

    def render(
        self,
        world_from_rig: Floats,
        world_from_objects: Sequence[Floats] = (),
        details: HitDetails = NO_DETAILS,
    ) -> Hits:
        """Intersect all rays from a pose (4, 4), with the dynamic objects at their poses.

        Details that textures change need a `visibility` that draws them.
        """
        visibility, buffers = self.visibility, self.visibility.buffers
        transforms = buffers.instance_transforms(world_from_rig[:3, 3], world_from_objects)
        if details not in self._variants:
            self._variants[details] = self._variant(details)
        variant, rig_from_optical = self._variants[details], self.pixels.camera.rig_from_optical
        viewpoint_from_optical = world_from_rig[:3, :3] @ rig_from_optical
        variant.viewpoint_from_optical.write(columns_first(viewpoint_from_optical))
        for part in self.using_parts(variant.vertex_array.program, rig_from_optical):
            visibility.render([(world_from_rig, world_from_objects)], details)
            with within(variant.target, part.rectangle_px):
                self.tables.update(transforms, transforms.normal_from_mesh)
                self.bind()
                visibility.bind_details(details, DETAIL_UNITS)
                self.bind_geometry()
                variant.vertex_array.render()
        return self.begin_reading(variant.target, 1, details).result()[0]

    def using_parts(
        self, program: moderngl.Program, rig_from_optical: Floats
    ) -> Iterator[ImagePart]:
        """Yield each part, with its tiles in use by the visibility pass and by a program."""
        for part in self.parts:
            if len(self.parts) > 1:
                self.visibility.use_plan(part.plan)
                bind_tiles(program, part.plan, rig_from_optical)
            yield part

    def begin_reading(
        self, target: moderngl.Framebuffer, count: int, details: HitDetails
    ) -> Pending[list[Hits]]:
        """Begin to read the hits of `count` images, which are stacked vertically."""
        width, height = self.pixels.size_px
        points = np.empty((count, height, width, 4), dtype=np.float32)
        primitives = np.empty((count, height, width, 2), dtype=np.uint32)
        none = np.empty((count, 0, width, 3), dtype=np.float32)
        arrays = dict.fromkeys(details._fields, none)
        outs: list[NDArray[Any]] = [points, primitives]  # by attachment
        for name in details.components:
            parts = _PARTS[name]
            arrays[name] = np.empty((count, height, width, sum(parts)), dtype=np.float32)
            outs += np.split(arrays[name], np.cumsum(parts)[:-1], axis=-1)
        region = (0, 0, width, count * height)
        reads: list[Read] = [
            (Pixels(target, number, region), out) for number, out in enumerate(outs)
        ]
        reading = self.readback.start(*reads)

        def finish() -> list[Hits]:
            reading.finish()
            return [
                Hits(
                    points[one], primitives[one, ..., 0], primitives[one, ..., 1],
                    **{name: values[one] for name, values in arrays.items()},
                )
                for one in range(count)
            ]  # fmt: skip

        return Pending(finish)

    def put_points(self, hits: Hits) -> None:
        """Replace the points of the last hits, for occlusion."""
        self.points.write(np.ascontiguousarray(hits.points_and_ranges_m))

    def bind_geometry(self) -> None:
        """Bind vertices and indices, from which normals are interpolated."""
        buffers = self.visibility.buffers
        bind_triangles(buffers.context, buffers.vertices, buffers.triangles.indices)

    def bind(self) -> None:
        """Bind the rays."""
        self._rays.use(RAYS_UNIT)

    def prepare(self, program: moderngl.Program, rig_from_optical: Floats) -> None:
        """Set the constant uniforms of a program, with rig_from_optical (3, 3)."""
        self.tables.bind_program(program, rig_from_optical)
        uniform(program, "u_rays").value = RAYS_UNIT

    def _variant(self, details: HitDetails) -> _Variant:
        context = self.pixels.context
        program = self.build_program(details)
        with gpu_allocation(self._what, "make the image smaller"):
            target = hits_target(
                context, self.pixels.size_px, [self.points, self.primitives], details
            )
        array = valid_pixels_array(context, program, self.pixels.valid)
        return _Variant(target, uniform(program, "u_viewpoint_from_optical"), array)

    def build_program(self, details: HitDetails, *defines: str) -> moderngl.Program:
        """Compile a program of hits, and set its constant uniforms."""
        program = build_program(
            self.pixels.context,
            "capture/image.vert",
            self.shader,
            (*self._compiled_windows, *(_DEFINES[name] for name in details.components), *defines),
        )
        self.prepare(program, self.pixels.camera.rig_from_optical)
        for name in atlas_formats(details):
            uniform(program, name).value = DETAIL_UNITS[name]
        return program


def hits_target(
    context: moderngl.Context,
    size: tuple[int, int],
    points_and_primitives: Sequence[moderngl.Texture | moderngl.Renderbuffer],
    details: HitDetails,
) -> moderngl.Framebuffer:
    """Target without hits: pixels without a ray are never drawn."""
    attachments = [renderbuffer(context, size, 4, dtype="f4")] if details.normals else []
    attachments += [renderbuffer(context, size, 4, dtype="f2") for _ in atlas_formats(details)]
    target = framebuffer(context, [*points_and_primitives, *attachments])
    nothing = 0.0, 0.0, 0.0, np.inf
    clear_target(target, nothing, None, *(nothing for _ in attachments))
    return target
