"""A camera's frame, from poses to pixels.

`CubePass.draw` draws what the virtual cameras see: meshes, probes, shadows, mirrors, atlas, mip
levels. `CameraFrame` makes the image of it: sampling, exposure, degradation, readback. Batches, in
`frame_batches.py`, draw their atlases by the same method.
"""

from __future__ import annotations

from collections.abc import Generator, Sequence
from contextlib import closing, nullcontext
from typing import TYPE_CHECKING, Any

import moderngl
import numpy as np

from omnisim.core.arrays import Floats32
from omnisim.core.errors import GraphicsError
from omnisim.core.pending import Pending
from omnisim.core.short_repr import counted
from omnisim.rendering.atlas.image_parts import ImagePart
from omnisim.rendering.atlas.tile_plan import Tile, TilePlan
from omnisim.rendering.contract import Readback, ScenePoses, SubFrames
from omnisim.rendering.opengl.capture.image_pass import AtlasLevels, image_pass
from omnisim.rendering.opengl.capture.mesh_and_lens import PixelMap
from omnisim.rendering.opengl.gl.buffers import gpu_allocation
from omnisim.rendering.opengl.gl.framebuffers import (
    attach_layer,
    attach_texture,
    clear_target,
    draws_layers,
    framebuffer,
    layered_target,
    resolve,
)
from omnisim.rendering.opengl.gl.gpu_textures import (
    DEPTH,
    depth_texture,
    renderbuffer,
    texture_2d,
    texture_array,
)
from omnisim.rendering.opengl.gl.pixel_readback import (
    PixelReadback,
    Read,
    TargetPixels,
    read_once,
)
from omnisim.rendering.opengl.scene_view import SceneView, TileRenderer, VirtualCameras
from omnisim.rendering.opengl.surfaces.scene_drawer import SkyPass
from omnisim.rendering.opengl.surfaces.surface_program import SurfacePrograms
from omnisim.rendering.opengl.world.scene_buffers import SceneBuffers

if TYPE_CHECKING:
    from omnisim.rendering.opengl.degradation.degradation_pass import DegradationPass
    from omnisim.rendering.opengl.reflect.mirror_pass import MirrorPass
    from omnisim.rendering.opengl.reflect.probe_pass import SceneProbes

_LAYER_TEXEL_BYTES = 12  # color and depth


class CameraFrame:
    """Draws the images of one camera in one scene; GPU resources are created once.

    Args:
        cube: virtual cameras.
        samples: pixel map of the supersampled camera.
        supersampling: samples per pixel side, averaged.
        degradation: passes of the effects; None: an ideal camera.
        parts: parts of the image, drawn one after the other; by default a single one.

    Attributes:
        size_px: width and height of the image.
        readback: ring of images that are read.
        image_pass: samples the atlas into the image.
        linear: texture of the linear image: RGB and validity.
        encoded_target: framebuffer with the encoded image alone.

    Raises:
        GraphicsError: an image larger than the GPU allows.
    """

    def __init__(
        self,
        cube: CubePass,
        samples: PixelMap,
        supersampling: int = 1,
        degradation: DegradationPass | None = None,
        parts: Sequence[ImagePart] | None = None,
    ):
        context, (width, height) = samples.context, samples.size_px
        self._cube, self._degradation = cube, degradation
        self.readback = PixelReadback(context)
        self.size_px = width, height = (width // supersampling, height // supersampling)
        self._parts = parts or [ImagePart((0, 0, width, height), cube.plan)]
        self._make_pass(samples, supersampling)
        with gpu_allocation(f"an image of {width} × {height} px", "make it smaller"):
            linear_type = "f2" if degradation is None else "f4"
            self.linear = texture_2d(context, self.size_px, 4, dtype=linear_type)
            encoded = renderbuffer(context, self.size_px, 4)
            self.encoded_target = framebuffer(context, [encoded])
            self._both_targets = framebuffer(context, [encoded, self.linear])
        # once: pixels without a ray are never drawn
        clear_target(self._both_targets)

    def _make_pass(self, samples: PixelMap, supersampling: int) -> None:
        self.image_pass = image_pass(samples, self._parts, supersampling)

    def begin(self, frames: SubFrames) -> Pending[Readback]:
        """Begin to render an image, from the parts of its exposure to its pixels.

        A luminance that is only reported is read with the image. One that sets the exposure is
        read before: its logarithm has other digits on GPUs, and noise shows them.
        """
        degradation = self._degradation
        if degradation is None:
            self.draw(frames.parts[0].poses, frames.linear)
            return self._begin_reading(self.linear if frames.linear else None)
        for sub_frame in frames.parts:
            self.draw(sub_frame.poses, linear=True)
            degradation.add(self.linear, sub_frame.row_weights)
        metered = None if frames.meter is None else degradation.draw_meter(frames.meter)
        luminance, reads = None, [] if metered is None else [metered[0]]
        if metered is not None and not frames.is_exposed:
            self.readback.read(*reads)
            luminance, reads, metered = metered[1](), [], None
        exposed = frames.expose(luminance)
        degradation.finish({"u_exposure_factors": exposed.factors, "u_frame": exposed.frame_number})
        degradation.encode(self.encoded_target)
        image = self._begin_reading(degradation.finished if frames.linear else None, *reads)
        return image.then(
            lambda done: done._replace(luminance=metered[1]() if metered else luminance)
        )

    def draw(self, poses: ScenePoses, linear: bool) -> None:
        """Draw the encoded image and, on request, the linear one: part by part, atlas and image."""
        target = self._both_targets if linear else self.encoded_target
        for part in self._parts:
            self._cube.use_plan(part.plan)
            self._cube.draw((poses,))
            self.image_pass.draw(self._cube.atlas, target, part)

    def _begin_reading(self, linear: moderngl.Texture | None, *others: Read) -> Pending[Readback]:
        """Begin to read the encoded image, a linear one, and what else was drawn for it."""
        width, height = self.size_px
        rgba = np.empty((height, width, 4), dtype=np.uint8)
        reads: list[Read] = [(TargetPixels(self.encoded_target), rgba), *others]
        floats = None
        if linear is not None:
            floats = np.empty((height, width, 3), dtype=np.float32)
            reads.append((linear, floats))
        reading = self.readback.start(*reads)
        return Pending(reading.finish).then(lambda _: Readback(rgba, floats))

    def refresh(self) -> None:
        """Update after the buffers changed."""
        self._cube.refresh()


class AtlasLayers:
    """Array of atlases, one layer per shot.

    Attributes:
        atlases, levels: the texture array, and its mip levels.
        drawn: view and target of all layers together; None: not yet drawn so.
    """

    def __init__(self, atlases: moderngl.TextureArray, levels: AtlasLevels):
        self.atlases, self.levels = atlases, levels
        self.drawn: tuple[SceneView, moderngl.Framebuffer] | None = None


class TriangleCounter:
    """Counts the triangles that are submitted within `with` blocks, and waits for the GPU.

    Attributes:
        triangles: their number, of all blocks.
    """

    def __init__(self, context: moderngl.Context):
        self._query: Any = context.query(primitives=True)
        self.triangles = 0

    def __enter__(self) -> None:
        self._query.__enter__()

    def __exit__(self, *raised: object) -> None:
        self._query.__exit__(*raised)
        self.triangles += self._query.primitives


class CubePass:
    """Draws what the virtual cameras at the effective viewpoint see: tiles, in one atlas texture.

    Args:
        buffers: scene and dynamic objects; other passes may share them.
        programs: surface programs for the scene's lights.
        plan: tiles of the atlas.
        cameras: virtual cameras.
        whole: tiles of the whole image, if `plan` are those of a part of it.

    Attributes:
        plan: see the arguments.
        atlas: linear RGBA half floats, top row of each face's image first.
        levels: its mip levels.
        counter: counts the triangles of `draw`; None: they are not counted.

    Raises:
        GraphicsError: the atlas is larger than the GPU allows.
    """

    counter: TriangleCounter | None = None

    def __init__(
        self,
        buffers: SceneBuffers,
        programs: SurfacePrograms,
        plan: TilePlan,
        cameras: VirtualCameras,
        whole: TilePlan | None = None,
    ):
        context = buffers.context
        self._context, self._buffers = context, buffers
        self.plan = self._first_plan = plan
        self._whole = whole or plan
        self._background = cameras.background
        size = (plan.width_px, plan.height_px)
        samples = min(cameras.samples, int(context.max_samples))
        with gpu_allocation(
            f"an atlas of {size[0]} × {size[1]} px with {counted(samples, 'sample')}",
            "make the image, or virtual_cameras.texels_per_pixel, size_px or samples smaller",
        ):
            self.atlas = texture_2d(context, size, 4, dtype="f2", levels=1 + plan.max_level)
            self._resolved = framebuffer(context, [self.atlas])
            color: moderngl.Texture | moderngl.Renderbuffer = self.atlas
            if samples > 1:
                color = renderbuffer(context, size, 4, dtype="f2", samples=samples)
            # multisampled depth cannot be read, and one sample may show what another occludes
            self._depth = None if samples > 1 else depth_texture(context, size)
            depth = self._depth or renderbuffer(context, size, 1, DEPTH, samples)
            self._target = framebuffer(context, [color], depth)
        self.levels = self._finish_atlas(self.atlas)
        self._is_multisampled = samples > 1
        self._cameras, self._programs, self._samples = cameras, programs, samples
        self._shadows = None if cameras.unlit else programs.shadows
        sky = programs.sky_seen(cameras.unlit)
        self._sky = None if sky is None else SkyPass(context, sky, plan)
        self.refresh()

    def _finish_atlas(self, atlas: moderngl.Texture | moderngl.TextureArray) -> AtlasLevels:
        """Set how an atlas is sampled; return its mip levels."""
        levels = AtlasLevels(atlas, self.plan.max_level)
        mipmapped = moderngl.LINEAR_MIPMAP_LINEAR if self.plan.max_level else moderngl.LINEAR
        atlas.repeat_x = atlas.repeat_y = False
        atlas.filter = (mipmapped, moderngl.LINEAR)
        return levels

    def refresh(self) -> None:
        """Update after the buffers changed."""
        self.use_plan(self._first_plan)
        probes = self._make_probes()
        shown = self._buffers.shown(self._cameras.hidden)
        with_probe = [] if probes is None else [item for item in probes.items if shown[item]]
        self._shown_with_probe = np.array(with_probe, dtype=np.intp)
        self._view = SceneView(
            self._buffers,
            self._programs,
            self.plan,
            self._cameras,
            self._depth,
            self._samples,
            self._sky,
            self._make_mirrors(probes),
            probes=probes,
        )

    def use_plan(self, plan: TilePlan) -> None:
        """Draw other tiles, at most as many as at first, in an atlas of the same size."""
        if plan is not self.plan:
            self.plan = plan
            for planned in (self.tiles, self._sky, *self._view.mirrors):
                if planned is not None:
                    planned.use_plan(plan)

    @property
    def tiles(self) -> TileRenderer:
        """Renderer of the tiles."""
        return self._view.tiles

    def _make_probes(self) -> SceneProbes | None:
        """Pass of the reflection probes; None: no surface has one, or base colors are shown."""
        mirrors, probes = self._cameras.mirrors, self._cameras.reflection_probes
        places = self._buffers.reflectors.drawn(mirrors, probes)
        if self._cameras.unlit or not places:
            return None
        from omnisim.rendering.opengl.reflect.probe_pass import shared_probes  # few scenes need it

        return shared_probes(self._buffers, self._programs, places, self._background)

    def _make_mirrors(self, probes: SceneProbes | None) -> list[MirrorPass]:
        """Passes of the views in mirrors and in panes; none if base colors are shown."""
        buffers = self._buffers
        if self._cameras.unlit or not self._cameras.mirrors:
            return []
        planes = ((buffers.mirrors, False), (buffers.pane_mirrors, True))
        if not any(mirrors for mirrors, _ in planes):
            return []
        from omnisim.rendering.opengl.reflect.mirror_pass import MirrorPass  # few scenes need it

        return [
            MirrorPass(
                buffers,
                mirrors,
                of_panes,
                self._programs,
                self.plan,
                self._whole,
                self._cameras,
                self._sky,
                probes,
            )
            for mirrors, of_panes in planes
            if mirrors
        ]

    def draw(self, shots: Sequence[ScenePoses], layers: AtlasLayers | None = None) -> None:
        """Draw all tiles from the poses of shots.

        Args:
            shots: poses of the rig and the objects; one, or one per layer.
            layers: atlases to draw, one per shot; None: `atlas`, from a single shot.
        """
        with closing(self._drawn_together(shots, layers)) as groups:
            for some, view, target in groups:
                shot = some[0]  # the others share its shadow maps, probes and mirrors
                self._buffers.deform(shot.world_from_objects)
                if view.probes is not None:
                    view.probes.render(self._seen_in_probes(view, shot), shot.world_from_objects)
                if self._shadows is not None:
                    self._shadows.prepare(shot.viewpoint_m, shot.world_from_objects)
                self._programs.bind_tables()
                for mirrors in view.mirrors:
                    mirrors.render(view, shot)
                view.tiles.begin(target, [(*self._background, 1.0)])
                with self.counter or nullcontext():
                    view.draw(target, some)
                if self._is_multisampled:
                    resolve(self._resolved, target)
        (self if layers is None else layers).levels.draw(len(shots))

    def _drawn_together(
        self, shots: Sequence[ScenePoses], layers: AtlasLayers | None
    ) -> Generator[tuple[Sequence[ScenePoses], SceneView, moderngl.Framebuffer], None, None]:
        """Shots with the view and the target that draw them: all at once, or one by one."""
        if layers is None:
            yield shots, self._view, self._target
        elif self._can_share(shots):
            if layers.drawn is None:
                layers.drawn = self._layered_view(layers.atlases)
            yield shots, *layers.drawn
        else:
            color = self._resolved if self._is_multisampled else self._target
            try:
                for layer, shot in enumerate(shots):
                    attach_layer(color.glo, layers.atlases.glo, layer)
                    yield (shot,), self._view, self._target
            finally:
                attach_texture(color.glo, self.atlas.glo)

    def _can_share(self, shots: Sequence[ScenePoses]) -> bool:
        """True if clusters and sorted items are all that the shots show, with the same shadows.

        A layer has the viewport and matrices of a single atlas, and therefore the same bytes.
        """
        has_clusters = self.tiles.culler is not None and not self.tiles.has_items
        if self._is_multisampled or not has_clusters or not draws_layers(self._context):
            return False
        if not all(self._view.sorts_blended(shot) for shot in shots):
            return False
        return self._shadows is None or self._shadows.are_shared(shots)

    def make_layers(self, count: int) -> AtlasLayers:
        """Atlases of `count` shots."""
        size = (self.plan.width_px, self.plan.height_px, count)
        atlases = texture_array(self._context, size, 4, levels=1 + self.plan.max_level)
        return AtlasLayers(atlases, self._finish_atlas(atlases))

    def _layered_view(
        self, atlases: moderngl.TextureArray
    ) -> tuple[SceneView, moderngl.Framebuffer]:
        """View of all layers of an array together, and its target."""
        target, depth = layered_target(self._context, atlases)
        count, sky = atlases.layers, self._programs.sky_seen(self._cameras.unlit)
        view = SceneView(
            self._buffers,
            self._programs,
            self.plan,
            self._cameras,
            depth,
            1,
            None if sky is None else SkyPass(self._context, sky, self.plan, count),
            layers=count,
        )
        return view, target

    @property
    def bytes_of_layer(self) -> int:
        """Size of a layer, and of its buffers for culling and sorting, bytes."""
        plan = self.plan
        texels = plan.width_px * plan.height_px * (2 if plan.max_level else 1)
        blended_drawer = self._view.blended_drawer
        sorted_bytes = 0 if blended_drawer is None else blended_drawer.memory_bytes
        return _LAYER_TEXEL_BYTES * texels + self.tiles.culling_bytes + sorted_bytes

    def _seen_in_probes(self, view: SceneView, shot: ScenePoses) -> frozenset[int]:
        """Indices of items with a probe that are in view, or may be so in a mirror."""
        if view.probes is not None and view.mirrors:
            return view.probes.items
        items = np.array([*self._buffers.showing(self._shown_with_probe, shot)], dtype=np.intp)
        if not items.size:
            return frozenset()
        transforms = self._buffers.instance_transforms(shot.viewpoint_m, shot.world_from_objects)
        seen = transforms.seen_in(view.tiles.views.at(shot.world_from_rig), items)
        return frozenset(items[seen.any(axis=0)].tolist())

    @property
    def depth(self) -> moderngl.Texture:
        """Depth (height, width) of the last rendered atlas, without blended surfaces.

        Raises:
            GraphicsError: the atlas is multisampled.
        """
        if self._depth is None:
            raise GraphicsError("virtual_cameras.samples: expected 1 to read depth, got more")
        return self._depth

    def read_face(self, tile: Tile) -> Floats32:
        """Read the 90° of a face as last rendered: linear RGB (size, size, 3), top row first.

        The tile must cover the whole face.
        """
        size = tile.face_size_px
        pixels = np.empty((size, size, 3), dtype=np.float32)
        region = (*tile.face_corner_px, size, size)
        read_once(self._buffers.context, (TargetPixels(self._resolved, region=region), pixels))
        return pixels
