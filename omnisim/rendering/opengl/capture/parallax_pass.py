"""Image of rays with their own origins, sampled from the atlas of one viewpoint and its depth."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import moderngl
import numpy as np

from omnisim.core.arrays import Bools, Floats32, Indices
from omnisim.core.cube import FACE_FROM_RIG, FACE_NAMES
from omnisim.rendering.atlas.parallax_plan import MARGIN_PX, ParallaxRays, SampleRays
from omnisim.rendering.atlas.tile_plan import TilePlan
from omnisim.rendering.opengl.capture.image_pass import image_array
from omnisim.rendering.opengl.capture.mesh_and_lens import valid_pixels_array
from omnisim.rendering.opengl.gl.buffers import gpu_allocation, gpu_buffer
from omnisim.rendering.opengl.gl.framebuffers import clear_target, framebuffer, use_target
from omnisim.rendering.opengl.gl.functions import StorageBindings
from omnisim.rendering.opengl.gl.gpu_textures import (
    copy_textures,
    depth_texture,
    renderbuffer,
    texture_2d,
)
from omnisim.rendering.opengl.gl.pixel_readback import PixelReadback, TargetPixels
from omnisim.rendering.opengl.gl.shader_files import (
    build_compute_shader,
    build_program,
    columns_first,
    set_uniforms,
    uniform,
    write_fog,
)
from omnisim.scene.model import Fog

# texture units
_ATLAS, _RAYS, _ORIGINS, _RIM_RAYS, _SURFACES, _SAMPLES = range(6)
_DEPTH, _BLOCKS, _CELL_TILES = 8, 9, 10
_RIM_ROW = 1 << 12  # texels per row of the rim's rays, as in capture/parallax_rays.glsl
_SAMPLE_ROW = 1 << 10  # samples per row of those drawn one by one
_PARTS = 64  # maximum samples per pixel, as in capture/parallax_samples.frag
_LEFT = 1  # attachment
_GREEN = 1  # its rays decide which pixels are valid
_CELLS = 64  # per face side; tiles end at cell edges; as in first_surface.glsl
_BLOCK, _BLOCKS_PER_GROUP = 8, 8  # per side, as in depth_bounds.comp
_GROUP_SIZE = 8  # invocations per side, as there

# Linear RGB (n, 3) along rays (n,).
CastSamples = Callable[[SampleRays], Floats32]


class ParallaxPass:
    """Image pass of a camera whose rays do not pass through one point.

    A refracting camera has rays for each color: they are drawn one after the other, from one atlas.

    Args:
        colors: sample rays from the viewpoint, rig frame; one set, or one each for R, G and B.
        pyramid: hierarchical depth of the atlas.
        fog: fog in the atlas, as seen from the viewpoint; None: clear air.

    Attributes:
        undecided_samples: number of undecided samples in the last image, all colors.

    Raises:
        GraphicsError: out of GPU memory.
    """

    def __init__(
        self,
        context: moderngl.Context,
        colors: Sequence[ParallaxRays],
        plan: TilePlan,
        pyramid: DepthPyramid,
        fog: Fog | None = None,
    ):
        self._pyramid, self.undecided_samples = pyramid, 0
        shown = colors[0].shown if len(colors) == 1 else colors[_GREEN].valid_shares() >= 0.5
        self._colors = [_ColorPass(context, color, plan, pyramid, shown, fog) for color in colors]

    def draw(
        self,
        atlas: moderngl.Texture,
        depth: moderngl.Texture,
        target: moderngl.Framebuffer,
        cast: CastSamples | None,
    ) -> None:
        """Draw the valid pixels; `cast` colors undecided samples; without, occluders are thin."""
        self._pyramid.update(depth)
        if len(self._colors) == 1:
            self.undecided_samples = self._colors[0].draw(atlas, target, cast)
            return
        self.undecided_samples = 0
        for channel, color in enumerate(self._colors):
            _write_only(target, [channel == other for other in range(3)] + [channel == _GREEN])
            try:
                self.undecided_samples += color.draw(atlas, target, cast)
            finally:
                _write_only(target, [True] * 4)


def _write_only(target: moderngl.Framebuffer, channels: Sequence[bool]) -> None:
    """Set the RGBA channels that drawing writes, in all attachments."""
    mask, count = tuple(channels), len(target.color_attachments)
    masks = mask if count == 1 else (mask,) * count
    setattr(target, "color_mask", masks)  # noqa: B010  moderngl's stubs know one attachment only


class _ColorPass:
    """Draws one set of rays, for the pixels `shown` (height, width)."""

    def __init__(
        self,
        context: moderngl.Context,
        rays: ParallaxRays,
        plan: TilePlan,
        pyramid: DepthPyramid,
        shown: Bools,
        fog: Fog | None,
    ):
        self._context, self._sample_rays, self._plan = context, rays, plan
        self._pyramid, self._fog, self._readback = pyramid, fog, PixelReadback(context)
        self._size = width, height = rays.smooth.shape[1], rays.smooth.shape[0]
        self._what = f"a capture of {width} × {height} px"
        with gpu_allocation(self._what, "make the image or camera.supersampling smaller"):
            self._rays = _ray_textures(context, rays)
            self._surfaces = texture_2d(context, self._size, 4)
            self._colors = texture_2d(context, self._size, 4)
            left = renderbuffer(context, self._size, 2, dtype="u4")
        self._surfaces_target = framebuffer(context, [self._surfaces])
        self._target = framebuffer(context, [self._colors, left])
        # once: pixels without a ray are never drawn
        clear_target(self._surfaces_target, (0.0, 0.0, 0.0, -1.0))
        clear_target(self._target, (0.0, 0.0, 0.0, 0.0), None)
        self._valid_bits = rays.valid_bits()
        self._samples, self._samples_target = self._allocate_samples(1)
        self._surfaces_array, self._pixels_array = (
            valid_pixels_array(context, self._program("capture/image.vert", name), rays.shown)
            for name in ("surfaces", "parallax")
        )
        program = self._program("common/full_screen.vert", "parallax_samples")
        uniform(program, "u_width_px").value = width
        self._samples_array = context.vertex_array(program, [])
        self._samples_array.vertices = 3
        self._image_array = image_array(context, rays.shown & shown, 1)

    def _program(self, vertex: str, fragment: str) -> moderngl.Program:
        plan = self._plan
        defines = ["MIP_LEVELS"] if plan.max_level else []
        defines.append(f"SUPERSAMPLING {self._sample_rays.supersampling}")
        if self._fog is not None:
            defines.append("FOG")
        program = build_program(self._context, vertex, f"capture/{fragment}.frag", defines)
        self._pyramid.bind_program(program)
        if self._fog is not None:
            write_fog(program, self._fog)
        values = {
            "u_atlas": _ATLAS,
            "u_rays": _RAYS,
            "u_origins": _ORIGINS,
            "u_rim_rays": _RIM_RAYS,
            "u_surfaces": _SURFACES,
            "u_samples": _SAMPLES,
            "u_atlas_px": (plan.width_px, plan.height_px),
            "u_max_level": float(plan.max_level),
            "u_level_bias": plan.level_bias,
        }
        set_uniforms(program, values)
        return program

    def draw(
        self, atlas: moderngl.Texture, target: moderngl.Framebuffer, cast: CastSamples | None
    ) -> int:
        """Draw by the pyramid's current depth; return the number of undecided samples."""
        for unit, texture in enumerate(self._rays, start=_RAYS):
            texture.use(unit)
        atlas.use(_ATLAS)
        use_target(self._surfaces_target)
        self._surfaces_array.render()
        self._surfaces.use(_SURFACES)
        use_target(self._target)
        self._pixels_array.render()
        undecided_samples = self._add_samples_left(cast)
        self._colors.use(_ATLAS)
        use_target(target)
        self._image_array.render()
        return undecided_samples

    def _add_samples_left(self, cast: CastSamples | None) -> int:
        """Add the samples that the pass over the pixels left, one by one; count the undecided."""
        width, height = self._size
        samples = self._sample_rays.supersampling**2
        bits = np.empty((height, width, 2), dtype="<u4")
        self._readback.read((TargetPixels(self._target, _LEFT), bits))
        left = bits.view("<u8").ravel() & self._valid_bits
        pixels = np.flatnonzero(left)
        of_pixels = left[pixels, None].view(np.uint8)
        unpacked = np.unpackbits(of_pixels, axis=1, count=samples, bitorder="little")
        at, parts = np.nonzero(unpacked)  # index of each sample's pixel, and its number there
        if len(parts) == 0:
            return 0
        light = self._draw_samples(_PARTS * pixels[at] + parts)
        undecided = np.flatnonzero(light[:, 3] < 0.5)
        if cast is not None and len(undecided):
            rows, columns = np.divmod(pixels[at[undecided]], width)
            light[undecided, :3] = cast(self._sample_rays.of(rows, columns, parts[undecided]))
        colors = np.empty((len(self._valid_bits), 4), dtype=np.float32)
        self._readback.read((self._colors, colors))
        for channel in range(3):
            sums = np.bincount(at, light[:, channel], len(pixels))
            colors[pixels, channel] += 1.0 / samples * sums
        self._colors.write(colors)
        return len(undecided)

    def _draw_samples(self, samples: Indices) -> Floats32:
        """Linear RGB (n, 4) of samples (n,), with alpha 1 where the surface hit is known."""
        rows = -(-len(samples) // _SAMPLE_ROW)
        if rows > self._samples.height:
            self._samples, self._samples_target = self._allocate_samples(2 * rows)
        texels = np.zeros(rows * _SAMPLE_ROW, dtype="<u4")
        texels[: len(samples)] = samples
        viewport = (0, 0, _SAMPLE_ROW, rows)
        self._samples.write(texels, viewport=viewport)
        self._samples.use(_SAMPLES)
        use_target(self._samples_target)
        self._samples_target.viewport = viewport
        self._samples_array.render()
        light = np.empty((rows * _SAMPLE_ROW, 4), dtype=np.float32)
        self._readback.read((TargetPixels(self._samples_target, region=viewport), light))
        return light[: len(samples)]

    def _allocate_samples(self, rows: int) -> tuple[moderngl.Texture, moderngl.Framebuffer]:
        size = _SAMPLE_ROW, rows
        with gpu_allocation(self._what, "make the image or camera.supersampling smaller"):
            samples = texture_2d(self._context, size, 1, dtype="u4")
            light = renderbuffer(self._context, size, 4, dtype="f4")
            return samples, framebuffer(self._context, [light])


def _ray_textures(context: moderngl.Context, rays: ParallaxRays) -> list[moderngl.Texture]:
    """Rays and origins of pixels, and rays of the rim, as `capture/parallax.frag` reads them.

    Raises:
        AllocationError: no memory for them.
    """
    height, width = rays.directions.shape[:2]
    inner = slice(MARGIN_PX, -MARGIN_PX)
    samples = rays.supersampling**2
    rim_texels = np.where(rays.rim_numbers >= 0, 1 + 2 * samples * rays.rim_numbers, 0)
    textures = []
    for values, own in ((rays.directions, rays.valid_shares()), (rays.origins_m, rim_texels)):
        texels = np.zeros((height, width, 4), dtype=np.float32)
        texels[..., :3] = values
        texels[inner, inner, 3] = own
        textures.append(texture_2d(context, (width, height), 4, texels))
    count = 2 * samples * len(rays.rim_valid)
    texels = np.zeros((max(1, -(-count // _RIM_ROW)) * _RIM_ROW, 4), dtype=np.float32)
    texels[:count:2, :3] = rays.rim_directions.reshape(-1, 3)
    texels[1:count:2, :3] = rays.rim_origins_m.reshape(-1, 3)
    size = _RIM_ROW, len(texels) // _RIM_ROW
    return [*textures, texture_2d(context, size, 4, texels)]


class DepthPyramid:
    """Depth textures for programs that include `capture/first_surface.glsl`.

    Args:
        plan: tiles of the atlas, whose regions end at multiples of 1/32.
        near_m, far_m: clip planes of the virtual cameras; far may be infinite.
        longest_m: maximum distance of the rays' origins from the viewpoint.

    Raises:
        GraphicsError: out of GPU memory.
    """

    def __init__(
        self,
        context: moderngl.Context,
        plan: TilePlan,
        near_m: float,
        far_m: float,
        longest_m: float,
    ):
        self._context, size = context, (plan.width_px, plan.height_px)
        columns, rows = (-(-side // _BLOCK) for side in size)
        groups = -(-columns // _BLOCKS_PER_GROUP) * -(-rows // _BLOCKS_PER_GROUP)
        with gpu_allocation(f"depth of {size[0]} × {size[1]} px", "make the image smaller"):
            self._depth = depth_texture(context, size)
            self._bounds = texture_2d(context, (columns, rows + 1), 2)
            cells = _cell_tiles(plan)
            self._cells = texture_2d(context, cells.shape[1::-1], 4, cells)
            no_surface = np.zeros(1 + groups, dtype="<u4")
            self._empty = gpu_buffer(context, no_surface)
            self._groups = gpu_buffer(context, no_surface)
            self._buffers = StorageBindings([gpu_buffer(context, 4 * columns * rows), self._groups])
        share = near_m / (far_m - near_m)  # depth is −share + near (1 + share) / z
        scale = 1.0 / (near_m * (1.0 + share))
        self._inverse_z_from_depth = (scale, share * scale)
        self._work_groups = -(-columns // _GROUP_SIZE), -(-rows // _GROUP_SIZE)
        self._find = build_compute_shader(context, "capture/depth_bounds.comp")
        self._find["u_inverse_z_from_depth"] = self._inverse_z_from_depth
        self._dilate = build_compute_shader(context, "capture/depth_bounds.comp", ("DILATE",))
        self._dilate["u_near_m"], self._dilate["u_longest_m"] = near_m, longest_m
        for program in (self._find, self._dilate):
            program["u_depth"] = _DEPTH
        self._near_m = near_m

    def bind_program(self, program: moderngl.Program) -> None:
        """Set the uniforms of a program."""
        values = {
            "u_depth": _DEPTH,
            "u_blocks": _BLOCKS,
            "u_cells": _CELL_TILES,
            "u_inverse_z_from_depth": self._inverse_z_from_depth,
            "u_near_m": self._near_m,
        }
        set_uniforms(program, values)
        uniform(program, "u_face_from_rig").write(columns_first(FACE_FROM_RIG))

    def update(self, depth: moderngl.Texture) -> None:
        """Copy the depth of the atlas, find its bounds, and bind the textures.

        The copy is never attached to a target: it may stay bound while the next image is drawn.
        """
        context = self._context
        copy_textures({depth: self._depth})
        context.copy_buffer(self._groups, self._empty)
        self._buffers.bind()
        for unit, texture in enumerate((self._depth, self._bounds, self._cells), start=_DEPTH):
            texture.use(unit)
        self._find.run(*self._work_groups)
        context.memory_barrier(context.SHADER_STORAGE_BARRIER_BIT)
        self._bounds.bind_to_image(0, read=False)
        self._dilate.run(*self._work_groups)
        context.memory_barrier(
            context.TEXTURE_FETCH_BARRIER_BIT | context.BUFFER_UPDATE_BARRIER_BIT
        )


def _cell_tiles(plan: TilePlan) -> Floats32:
    """Offset and scale from tangents to texels (cells, faces × cells, 4); 0: not in any tile."""
    cell_tiles = np.zeros((_CELLS, len(FACE_NAMES), _CELLS, 4), dtype=np.float32)
    for tile in plan.tiles:
        half_px = 0.5 * tile.face_size_px
        left, top = tile.face_corner_px
        # whole cells inside the tile
        begins = np.maximum(tile.region[0], tile.padded_region[0])
        ends = np.minimum(tile.region[1], tile.padded_region[1])
        begins = np.maximum(np.ceil(0.5 * _CELLS * (begins + 1.0) - 1e-6), 0.0)
        ends = np.maximum(np.floor(0.5 * _CELLS * (ends + 1.0) + 1e-6), 0.0)
        columns, rows = map(slice, begins.astype(int).tolist(), ends.astype(int).tolist())
        cell_tiles[rows, tile.face, columns] = (left + half_px, top + half_px, half_px, half_px)
    return cell_tiles.reshape(_CELLS, -1, 4)
