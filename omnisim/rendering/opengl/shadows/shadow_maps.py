"""Shadow maps of a scene's lamps, in one texture.

Static geometry is drawn once; each frame draws dynamic objects on a copy, in the few texels that
they cover. Cascades that follow the viewpoint move in steps, and keep most of what was drawn.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import AbstractContextManager
from typing import NamedTuple

import moderngl
import numpy as np

from omnisim.core.arrays import Bools, Floats, Indices, bounds_of
from omnisim.core.world import Poses, time_of
from omnisim.rendering.opengl.gl.buffers import gpu_allocation, written_buffer
from omnisim.rendering.opengl.gl.framebuffers import use_target
from omnisim.rendering.opengl.gl.reversed_depth import CLEAR_DEPTH
from omnisim.rendering.opengl.shadows.kept_cascades import DepthLevels, KeptCascades
from omnisim.rendering.opengl.shadows.shadow_drawer import CasterDrawer
from omnisim.rendering.opengl.shadows.shadow_plan import covered_px, make_shadow_plan
from omnisim.rendering.opengl.world.scene_buffers import SceneBuffers
from omnisim.scene.model import LAMP_NEAR_M, Lighting

_UNIT, _BLOCK_BINDING = 13, 1  # as in shaders/scene/shadow.glsl


class _Views(NamedTuple):
    """Views of all maps."""

    middles_m: Floats  # (lights, cascades, 2) centers of the cascades, which the matrices follow
    clips: Floats  # (maps, 4, 4) clip_from_anchor matrices


class ShadowMaps:
    """Shadow maps of the lamps that cast shadows.

    Args:
        lighting: lighting with at least one light that casts shadows.

    Attributes:
        anchor_m: (3,) origin of the maps' matrices, world.

    Raises:
        GraphicsError: the maps do not fit on the GPU.
    """

    def __init__(self, buffers: SceneBuffers, lighting: Lighting):
        self._buffers, self._lighting = buffers, lighting
        self._maps: list[DepthLevels] = []
        self._kept: KeptCascades | None = None
        self.refresh()

    def refresh(self) -> None:
        """Redraw what the changed buffers require, when it is next needed."""
        buffers, context = self._buffers, self._buffers.context
        boxes_m = _static_boxes_m(buffers)
        self.anchor_m = np.zeros(3)
        if buffers.clustered_geometry is not None:
            self.anchor_m = buffers.clustered_geometry.anchor_m
        elif len(boxes_m):
            self.anchor_m = 0.5 * (boxes_m[:, 0].min(axis=0) + boxes_m[:, 1].max(axis=0))
        limit = int(context.info["GL_MAX_TEXTURE_SIZE"])
        self._plan = plan = make_shadow_plan(self._lighting, boxes_m - self.anchor_m, limit)
        self._rectangles_px = plan.rectangles_px
        size_px = plan.width_px, plan.height_px
        self._drawer = CasterDrawer(
            buffers, self.anchor_m, self._rectangles_px, size_px, plan.follows_viewpoint
        )
        if self._maps and self._maps[0].size_px != size_px:
            self._maps = []
        while len(self._maps) < 1 + self._drawer.has_dynamic:
            with _allocation(size_px):
                like = self._maps[0] if self._maps else None
                self._maps.append(DepthLevels(context, size_px, like))
        if plan.follows_viewpoint:
            with _allocation(plan.kept_size_px):
                levels = None if self._kept is None else self._kept.levels
                self._kept = KeptCascades(context, plan, self._maps[0], levels)
        else:
            self._kept = None
        self._follows = plan.maps_that_follow
        self._drawn: _Views | None = None  # views of the drawn static maps
        at_anchor, _ = self._views(self.anchor_m)
        # empty if all casters have cubes
        self._block = written_buffer(context, plan.block_data(at_anchor.clips))
        self._posed: tuple[float, bytes] | None = None  # when, and where
        self._covered: Indices = np.empty((0, 4), dtype=np.intp)
        objects = np.array(
            [-1 if one.object_index is None else one.object_index for one in buffers.draw_items]
        )
        moves = np.array([one.moves for one in buffers.draw_items], dtype=np.bool_)
        dynamic = np.flatnonzero(moves & buffers.shown())
        self._dynamic = dynamic[np.argsort(objects[dynamic], kind="stable")]
        _, self._first_of_object = np.unique(objects[self._dynamic], return_index=True)

    @property
    def defines(self) -> tuple[str, ...]:
        """Defines of programs that look up shadows."""
        return (*self._plan.defines, f"LAMP_NEAR_M {LAMP_NEAR_M}")

    def are_shared(self, poses: Sequence[tuple[Floats, Sequence[Floats]]]) -> bool:
        """Tell whether poses of rigs and of the dynamic objects all share their maps."""
        at_rest = poses[0][1]
        if self._drawer.has_dynamic and not all(
            world is at_rest
            or (time_of(world) == time_of(at_rest) and np.array_equal(world, at_rest))
            for _, world in poses
        ):
            return False
        if not self._plan.follows_viewpoint:
            return True
        first, *others = (self._middles_m(rig[:3, 3]) for rig, _ in poses)
        return all(np.array_equal(one, first) for one in others)

    def connect(self, program: moderngl.Program) -> None:
        """Set the samplers and blocks of a program that looks up shadows."""
        if "u_shadow_maps" in program:
            program["u_shadow_maps"] = _UNIT

    def prepare(self, viewpoint_m: Floats, world_from_objects: Poses) -> None:
        """Draw the maps that a frame needs, and bind them; see `ShadowSource`."""
        views, stale = self._views(viewpoint_m)
        clips = views.clips
        if stale.any():
            if self._drawn is None:  # the static casters, in maps that do not follow the viewpoint
                fixed, first = ~self._follows, self._maps[0]
                use_target(first.target)
                first.target.clear(depth=CLEAR_DEPTH)  # of all maps: the others are copied later
                self._drawer.draw(first.target, clips, fixed, world_from_objects, dynamic=False)
                first.coarsen(self._rectangles_px[fixed].astype(int).tolist())
            if self._kept is not None:
                at_m = viewpoint_m - self.anchor_m
                self._kept.update(self._maps[0], at_m, self._drawer, world_from_objects)
            self._block.write(self._plan.block_data(clips))
            self._drawn = views
        if len(self._maps) > 1:
            self._draw_dynamic(clips, stale, world_from_objects)
        self._maps[-1].texture.use(_UNIT)
        self._block.bind_to_uniform_block(_BLOCK_BINDING)

    def _views(self, viewpoint_m: Floats) -> tuple[_Views, Bools]:
        """Views for a viewpoint (3,), world, and the mask (maps,) of those not yet drawn."""
        middles_m, drawn = self._middles_m(viewpoint_m), self._drawn
        if drawn is not None and np.array_equal(middles_m, drawn.middles_m):
            return drawn, np.zeros(len(drawn.clips), dtype=np.bool_)
        clips = self._plan.clips(middles_m, self.anchor_m)
        if drawn is None:
            return _Views(middles_m, clips), np.ones(len(clips), dtype=np.bool_)
        return _Views(middles_m, clips), np.any(clips != drawn.clips, axis=(1, 2))

    def _middles_m(self, viewpoint_m: Floats) -> Floats:
        return self._plan.middles_m(viewpoint_m - self.anchor_m)

    def _draw_dynamic(self, clips: Floats, stale: Bools, world_from_objects: Poses) -> None:
        """Draw the dynamic casters, and restore the static map where they were before."""
        time_s = time_of(world_from_objects) if self._buffers.deforming.size else 0.0
        posed = time_s, np.array(world_from_objects).tobytes()
        if posed == self._posed and not stale.any():
            return
        whole = self._rectangles_px[stale].astype(np.intp)
        static, live = self._maps
        for rectangle_px in np.concatenate((whole, self._covered)).tolist():
            live.copy(static, rectangle_px)
        transforms = self._buffers.instance_transforms(self.anchor_m, world_from_objects)
        self._covered = covered_px(
            clips,
            self._rectangles_px,
            transforms.centers_m[self._dynamic],
            transforms.radii_m[self._dynamic],
            self._first_of_object,
        )
        every = np.ones(len(clips), dtype=np.bool_)
        self._drawer.draw(live.target, clips, every, world_from_objects, dynamic=True)
        live.coarsen(self._covered.tolist())
        self._posed = posed


def _allocation(size_px: tuple[int, int]) -> AbstractContextManager[None]:
    return gpu_allocation(
        f"shadow maps of {size_px[0]} × {size_px[1]} px", "switch the lamps' shadows off"
    )


def _static_boxes_m(buffers: SceneBuffers) -> Floats:
    """Minimum and maximum corners (n, 2, 3) of the static geometry, world."""
    boxes_m = []
    for item in buffers.draw_items:
        if item.object_index is None:
            low, high = bounds_of(item.mesh.positions)
            linear = item.object_from_mesh[:3, :3]
            middle = linear @ (0.5 * (low + high)) + item.object_from_mesh[:3, 3]
            extent = np.abs(linear) @ (0.5 * (high - low))
            boxes_m.append((middle - extent, middle + extent))
    return np.array(boxes_m, dtype=np.float64).reshape(-1, 2, 3)
