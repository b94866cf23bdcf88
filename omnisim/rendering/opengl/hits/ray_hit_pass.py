"""Exact hits of images' rays: triangle, point, range, surface details; and their occlusion."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cached_property
from typing import Any, ClassVar

import moderngl
import numpy as np
from numpy.typing import NDArray

from omnisim.core.arrays import Bytes, Floats
from omnisim.core.pending import Pending
from omnisim.ground_truth.hits import NO_DETAILS, HitDetails, Hits
from omnisim.rendering.atlas.image_parts import ImagePart
from omnisim.rendering.contract import ScenePoses
from omnisim.rendering.opengl.capture.mesh_and_lens import (
    RAYS_UNIT,
    PixelMap,
    bind_tiles,
    valid_pixels_array,
)
from omnisim.rendering.opengl.gl.buffers import gpu_allocation
from omnisim.rendering.opengl.gl.framebuffers import clear_target, framebuffer, use_target, within
from omnisim.rendering.opengl.gl.gpu_textures import renderbuffer, texture_2d
from omnisim.rendering.opengl.gl.pixel_readback import PixelReadback, Read, TargetPixels
from omnisim.rendering.opengl.gl.shader_files import (
    build_program,
    columns_first,
    set_uniforms,
    uniform,
)
from omnisim.rendering.opengl.hits.visibility_pass import VisibilityPass, atlas_formats
from omnisim.rendering.opengl.world.draw_item import InstanceTransforms
from omnisim.rendering.opengl.world.geometry_store import (
    bind_triangles,
    table_texture,
    window_defines,
    write_table,
)
from omnisim.scene.surface_kind import SurfaceKind

_DETAIL_UNITS = {"u_albedos": 4, "u_gloss": 5, "u_emission": 7}
# Define and attachment components of each detail.
_DEFINES = {"normals": "NORMALS", "albedos": "ALBEDO", "materials": "MATERIALS"}
_PARTS = {"normals": (3,), "albedos": (3,), "materials": (2, 3)}


class RayHitPass:
    """Intersects images' rays with the visible triangles; GPU resources are created once.

    Args:
        visibility: pass that draws the triangle IDs.
        pixels: rays of the pixels.
        parts: parts of the image, drawn one after the other; by default a single one.
        images: maximum number of images that are drawn together, stacked vertically, from the
            layers of `visibility`; None: one image.

    Attributes:
        visibility, pixels, parts: see the arguments.
        points: points and ranges of one image as a texture, see `Hits`.
        primitives: 1 + draw item, and triangle in the item, likewise.
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
        self,
        visibility: VisibilityPass,
        pixels: PixelMap,
        parts: Sequence[ImagePart] | None = None,
        images: int | None = None,
    ):
        self.visibility, self.pixels, self._images = visibility, pixels, images
        visibility.buffers.check_readable("to look up what its pixels show")
        (width, height), context = pixels.size_px, pixels.context
        self._size_px = size = width, height * (images or 1)
        self.parts = parts or [ImagePart((0, 0, *size), visibility.plan)]
        self._allocation = f"ground truth of {width} × {height} px", "make the image smaller"
        if images is not None:
            self._allocation = f"ground truth of {images} images", "render fewer at once"
        with gpu_allocation(*self._allocation):
            self._held: list[moderngl.Texture | moderngl.Renderbuffer]
            if images is None:
                self.points = texture_2d(context, size, 4)
                self.primitives = texture_2d(context, size, 2, dtype="u4")
                self._held = [self.points, self.primitives]
            else:
                self._held = [
                    renderbuffer(context, size, 4, dtype="f4"),
                    renderbuffer(context, size, 2, dtype="u4"),
                ]
        self._drawings: dict[HitDetails, tuple[moderngl.Framebuffer, moderngl.VertexArray]] = {}
        self.tables = HitTables(visibility)
        self.readback = PixelReadback(context)
        self._compiled_windows = self._windows()

    def _windows(self) -> tuple[str, ...]:
        buffers = self.visibility.buffers
        return window_defines(buffers.context, buffers.vertices, buffers.indices)

    def refresh(self) -> None:
        """Update after the buffers changed."""
        self.visibility.buffers.check_readable("to look up what its pixels show")
        if self._windows() != self._compiled_windows:
            self._compiled_windows = self._windows()
            self._drawings = {}
        self.visibility.refresh()
        self.tables.refresh()

    def render(
        self, shots: Sequence[ScenePoses], details: HitDetails = NO_DETAILS
    ) -> Pending[list[Hits]]:
        """Begin to intersect the rays of one image a shot.

        Details that textures change need a `visibility` that draws them.
        """
        visibility, buffers = self.visibility, self.visibility.buffers
        (target, array), camera = self._drawing(details), self.pixels.camera
        transforms = [
            buffers.instance_transforms(shot.viewpoint_m, shot.world_from_objects) for shot in shots
        ]
        rotations = np.array(
            [shot.world_from_rig[:3, :3] @ camera.rig_from_optical for shot in shots]
        )
        # of a single image, and of several, which have their rotations in the tables
        set_uniforms(
            array.program,
            {
                "u_viewpoint_from_optical": columns_first(rotations[0]),
                "u_draw_item_count": 1 + len(buffers.draw_items),
            },
        )
        for part in self.using_parts(array.program, camera.rig_from_optical):
            visibility.render(shots, details)
            with within(target, part.rectangle_px):
                normals = [transform.normal_from_mesh for transform in transforms]
                self.tables.update(transforms, normals, rotations)
                self.bind()
                visibility.bind_details(details, _DETAIL_UNITS)
                # vertices and indices, from which normals are interpolated
                bind_triangles(buffers.context, buffers.vertices, buffers.triangles.indices)
                array.render(moderngl.TRIANGLES, instances=len(shots))
        return self.begin_reading(target, len(shots), details)

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
            (TargetPixels(target, number, region), out) for number, out in enumerate(outs)
        ]
        reading = self.readback.start(*reads)

        def finish() -> list[Hits]:
            reading.finish()
            return [
                Hits(
                    points[number], primitives[number, ..., 0], primitives[number, ..., 1],
                    **{name: values[number] for name, values in arrays.items()},
                )
                for number in range(count)
            ]  # fmt: skip

        return Pending(finish)

    @cached_property
    def occlusion(self) -> OcclusionPass:
        """Occlusion of the last hits from another viewpoint."""
        return OcclusionPass(self)

    def put_points(self, hits: Hits) -> None:
        """Replace the points of the last hits, for occlusion."""
        self.points.write(np.ascontiguousarray(hits.points_and_ranges_m))

    def bind(self) -> None:
        """Bind the rays."""
        self.pixels.rays.use(RAYS_UNIT)

    def prepare(self, program: moderngl.Program, rig_from_optical: Floats) -> None:
        """Set the constant uniforms of a program, with rig_from_optical (3, 3)."""
        self.tables.bind_program(program, rig_from_optical)
        uniform(program, "u_rays").value = RAYS_UNIT

    def _drawing(self, details: HitDetails) -> tuple[moderngl.Framebuffer, moderngl.VertexArray]:
        """Target of details, and rectangles with their program, created on first use."""
        if details in self._drawings:
            return self._drawings[details]
        context, images = self.pixels.context, self._images
        defines = [*self._compiled_windows, *(_DEFINES[name] for name in details.components)]
        defines += [] if images is None else ["BATCH"]
        program = build_program(context, "capture/image.vert", self.shader, defines)
        self.prepare(program, self.pixels.camera.rig_from_optical)
        for name in atlas_formats(details):
            uniform(program, name).value = _DETAIL_UNITS[name]
        with gpu_allocation(*self._allocation):
            more = [renderbuffer(context, self._size_px, 4, dtype="f4")] if details.normals else []
            more += [
                renderbuffer(context, self._size_px, 4, dtype="f2") for _ in atlas_formats(details)
            ]
            target = framebuffer(context, [*self._held, *more])
        # pixels without a ray are never drawn
        nothing = 0.0, 0.0, 0.0, np.inf
        clear_target(target, nothing, None, *(nothing for _ in more))
        if images is not None:
            uniform(program, "u_images").value = images
        array = valid_pixels_array(context, program, self.pixels.valid)
        self._drawings[details] = target, array
        return target, array


# Textures of the draw items, for shaders with `ground_truth/intersect.glsl`.
_DRAW_ITEM = np.dtype(  # as in shaders/ground_truth/tables.glsl
    [
        ("first", "<u4"),
        ("flags", "<u4"),
        ("unused", "<u4", 2),
        ("viewpoint_from_mesh", "<f4", (3, 4)),
        ("second_matrix", "<f4", (3, 4)),
        ("unused_too", "<u4", 4),
    ]
)
_MASKED, _DOUBLE_SIDED, _FLIPS_WINDING = 1, 2, 4  # flags
_UNITS = {"u_triangle_ids": 0, "u_corners": 2, "u_draw_items": 3, "u_primitives": 6}


class HitTables:
    """Textures of visible triangles and their draw items."""

    def __init__(self, visibility: VisibilityPass):
        self._visibility = visibility
        self.refresh()

    def refresh(self) -> None:
        """Update after the buffers changed."""
        visibility = self._visibility
        draws = visibility.buffers.draw_items
        self._draw_items = np.zeros(len(draws), dtype=_DRAW_ITEM)
        self._draw_items["first"] = [draw.first for draw in draws]
        self._draw_items["flags"] = [
            _MASKED * bool(draw.kind & SurfaceKind.HOLES)
            + _DOUBLE_SIDED * (draw.material.double_sided or visibility.cameras.both_sides)
            + _FLIPS_WINDING * draw.flips_winding
            for draw in draws
        ]
        self._texture: moderngl.Texture | None = None

    def bind_program(self, program: moderngl.Program, rig_from_optical: Floats) -> None:
        """Set the constant uniforms of a program, with rig_from_optical (3, 3)."""
        visibility = self._visibility
        bind_tiles(program, visibility.plan, rig_from_optical)
        for name, unit in _UNITS.items():
            uniform(program, name).value = unit
        cameras = visibility.cameras
        uniform(program, "u_depth_limits_m").value = cameras.near_m, min(cameras.far_m, 3e38)

    def update(
        self,
        transforms: Sequence[InstanceTransforms],
        second_matrices: Sequence[Floats],
        viewpoints_from_optical: Floats | None = None,
    ) -> None:
        """Write the draw items of images, and bind the tables.

        Args:
            transforms: transforms of the draw items, per image.
            second_matrices: second matrices (n, 3, 3) or (n, 3, 4) of the draw items, per image.
            viewpoints_from_optical: (images, 3, 3) camera rotations, if shaders read them here.
        """
        visibility, count = self._visibility, len(self._draw_items)
        tables = np.zeros((len(transforms), count + 1), dtype=_DRAW_ITEM)
        tables[:, :count] = self._draw_items
        for table, transform, second in zip(tables, transforms, second_matrices, strict=True):
            table["viewpoint_from_mesh"][:count] = transform.viewpoint_from_mesh[:, :3]
            table["second_matrix"][:count, :, : second.shape[-1]] = second
        if viewpoints_from_optical is not None:
            tables["viewpoint_from_mesh"][:, count, :, :3] = viewpoints_from_optical
        entries = tables.nbytes // 16
        if self._texture is None or self._texture.width * self._texture.height < entries:
            what = "the scene's instances" if len(tables) == 1 else "the instances of a batch"
            self._texture = table_texture(visibility.buffers.context, entries, what)
        write_table(self._texture, tables.ravel())
        visibility.id_atlas.use(_UNITS["u_triangle_ids"])
        visibility.buffers.triangles.corners.use(_UNITS["u_corners"])
        self._texture.use(_UNITS["u_draw_items"])
        visibility.triangle_ids.texture.use(_UNITS["u_primitives"])

    @property
    def image_bytes(self) -> int:
        """Size of one image's draw items, bytes."""
        return int(_DRAW_ITEM.itemsize * (len(self._draw_items) + 1))


# Occlusion of an image's points from the next viewpoint.
_POINTS_UNIT, _PRIMITIVES_UNIT = 4, 5


class OcclusionPass:
    """Casts a ray from the next viewpoint to each hit point; GPU resources are created once.

    Args:
        hits: pass of the current viewpoint; its triangle IDs are redrawn from the next one.

    Raises:
        GraphicsError: out of GPU memory.
    """

    def __init__(self, hits: RayHitPass):
        self._hits, pixels, context = hits, hits.pixels, hits.pixels.context
        defines = ("PARTS",) if len(hits.parts) > 1 else ()
        program = build_program(context, "capture/image.vert", hits.occlusion_shader, defines)
        hits.prepare(program, np.eye(3))
        uniform(program, "u_points").value = _POINTS_UNIT
        uniform(program, "u_hit_primitives").value = _PRIMITIVES_UNIT
        self._rig_from_viewpoint = uniform(program, "u_rig_from_viewpoint")
        self._vertex_array = valid_pixels_array(context, program, pixels.valid)
        occluded = renderbuffer(context, pixels.size_px, 1, dtype="u1")
        self._target = framebuffer(context, [occluded])
        # once: pixels without a ray are never drawn
        clear_target(self._target, None)

    def begin(self, other: ScenePoses, next_from_current: Floats) -> Pending[Bytes]:
        """Draw, and start to read; the result is the occlusion, encoded as in occlusion.frag.

        Args:
            other: next poses.
            next_from_current: (n, 3, 4) per draw item, from the current to the next viewpoint
                frame.
        """
        visibility = self._hits.visibility
        transforms = visibility.buffers.instance_transforms(
            other.viewpoint_m, other.world_from_objects
        )
        self._rig_from_viewpoint.write(columns_first(other.world_from_rig[:3, :3].T))
        if len(self._hits.parts) > 1:
            clear_target(self._target, None)
        # each part may show the points of all pixels
        for _ in self._hits.using_parts(self._vertex_array.program, np.eye(3)):
            visibility.render([other])
            use_target(self._target)
            self._hits.tables.update([transforms], [next_from_current])
            self._hits.bind()
            self._hits.points.use(_POINTS_UNIT)
            self._hits.primitives.use(_PRIMITIVES_UNIT)
            self._vertex_array.render()
        width, height = self._hits.pixels.size_px
        occluded = np.empty((height, width), dtype=np.uint8)
        reading = self._hits.readback.start((TargetPixels(self._target), occluded))
        return Pending(reading.finish).then(lambda _: occluded)
