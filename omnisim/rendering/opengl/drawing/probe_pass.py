"""Probe pass: the scene as seen from reflection probes, which curved and rough surfaces reflect.

All cameras share the probes. A probe is drawn again if an object has moved or a mesh has deformed
since; its light is therefore a function of the scene and its state alone. Planar metal mirrors
within a probe reflect the probe itself, as drawn without them; other reflective surfaces in it
reflect sky and lamps.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence

import moderngl
import numpy as np

from omnisim.core.arrays import Bools, Floats, Floats32
from omnisim.core.world import time_of
from omnisim.rendering.opengl.atlas.tile_plan import TilePlan, cube_plan
from omnisim.rendering.opengl.drawing.probe_maps import Gloss, ProbeMaps
from omnisim.rendering.opengl.drawing.scene_view import SceneParts, SceneView, VirtualCameras
from omnisim.rendering.opengl.drawing.sky_pass import SkyPass
from omnisim.rendering.opengl.drawing.surface_program import (
    PROBE_UNIT,
    SurfaceProgram,
    SurfacePrograms,
)
from omnisim.rendering.opengl.geometry.scene_buffers import SceneBuffers
from omnisim.rendering.opengl.gl.framebuffers import framebuffer
from omnisim.rendering.opengl.gl.gpu_textures import (
    bind_texture,
    copy_textures,
    depth_texture,
    texture_2d,
)
from omnisim.rendering.opengl.gl.memory import gpu_allocation
from omnisim.rendering.opengl.gl.state import GlState
from omnisim.scene.reflection_probes import ProbePlace
from omnisim.scene.surface_kind import lobe_roughnesses

SIZE_PX = 128  # of a face
_METAL = 0.5  # metalness from which a surface shows reflections alone
_NEAR_SHARE, _MAX_NEAR_M = 0.05, 0.05  # near plane, as a share of the smallest probe's radius


class _OwnProbe:
    """Probe from whose viewpoint the scene is drawn, for the planar metal mirrors within it.

    Attributes:
        items: indices of the mirrors' items.
        number: index of the probe's cube.
    """

    def __init__(self, buffers: SceneBuffers, name: int):
        items, self.number, self._name = buffers.draw_items, 0, name
        planar = {index for plane in buffers.mirrors for index in plane.parts}
        self.items = frozenset(one for one in planar if items[one].material.metallic > _METAL)
        self._items = [items[index] for index in self.items]

    def connect(
        self,
        programs: Collection[SurfaceProgram],
        viewpoint_m: Floats,
        world_from_objects: Sequence[Floats],
    ) -> None:
        """Set the probe of the mirrors, whose center is the viewpoint, and bind it."""
        probe = np.array((0.0, 0.0, 0.0, self.number), dtype=np.float32)
        for program in programs:
            program.set_probes({id(item): probe for item in self._items})
        bind_texture(PROBE_UNIT, self._name)


class ProbePass:
    """Draws the reflection probes of a scene; of no use once the buffers have changed.

    Args:
        buffers: scene and dynamic objects.
        programs: surface programs for the scene's lights.
        places: probes to draw.
        background: linear RGB of rays that hit nothing.

    Attributes:
        items: indices of the items that reflect a probe.

    Raises:
        GraphicsError: the probes do not fit on the GPU.
    """

    def __init__(
        self,
        buffers: SceneBuffers,
        programs: SurfacePrograms,
        places: Sequence[ProbePlace],
        background: tuple[float, float, float],
    ):
        context = buffers.context
        self._buffers, self._programs, self._places = buffers, programs, places
        self._background = background
        plan = cube_plan(SIZE_PX)
        size = plan.width_px, plan.height_px
        near_m = min(_MAX_NEAR_M, _NEAR_SHARE * min(one.radius_m for one in places))
        with gpu_allocation(f"an atlas of {size[0]} × {size[1]} px", "free GPU memory"):
            self._colors = texture_2d(context, size, 4, dtype="f2")
            self._depths = depth_texture(context, size)
        self._target = framebuffer(context, [self._colors], self._depths)
        self._maps = ProbeMaps(context, plan, near_m, len(places))
        self._own = _OwnProbe(buffers, self._maps.name)
        self._is_mirror = self._mask(self._own.items)
        self._view = self._make_view(plan, near_m)
        self.items = frozenset(index for one in places for index in one.surfaces)
        self._left_out = [self._mask(one.left_out) | self._is_mirror for one in places]
        self._mirrors = [self._is_mirror & ~self._mask(one.left_out) for one in places]
        self._gloss = [self._gloss_of(one) for one in places]
        self._states: list[bytes | None] = [None] * len(places)
        self._static: dict[int, tuple[moderngl.Texture, moderngl.Texture]] = {}
        self._has_moving = any(item.moves for item in buffers.draw_items)
        self._state = GlState()

    def _make_view(self, plan: TilePlan, near_m: float) -> SceneView:
        cameras = VirtualCameras(near_m, math.inf, background=self._background, mirrors=0)
        sky = self._programs.sky_seen(False)
        return SceneView(
            self._buffers,
            self._programs,
            plan,
            cameras,
            self._depths,
            1,
            None if sky is None else SkyPass(self._buffers.context, sky, plan),
            probes=self._own,
        )

    def _mask(self, left_out: Collection[int]) -> Bools:
        mask = np.zeros(len(self._buffers.draw_items), dtype=np.bool_)
        mask[list(left_out)] = True
        return mask

    def _gloss_of(self, place: ProbePlace) -> Gloss:
        """Gloss of a probe's surfaces."""
        materials = [self._buffers.draw_items[one].material for one in place.surfaces]
        return Gloss.of([value for one in materials for value in lobe_roughnesses(one)])

    def render(self, seen: Collection[int], world_from_objects: Sequence[Floats]) -> None:
        """Render the probes that items at the given indices reflect.

        Tables are bound, and meshes are deformed.
        """
        state = b"".join(np.asarray(one).tobytes() for one in world_from_objects)
        if self._buffers.deforming.size:
            state += np.float64(time_of(world_from_objects)).tobytes()
        for number, place in enumerate(self._places):
            if self._states[number] == state or place.surfaces.isdisjoint(seen):
                continue
            self._draw(number, world_from_objects)
            self._states[number] = state

    def _draw(self, number: int, world_from_objects: Sequence[Floats]) -> None:
        world_from_probe = np.eye(4)
        world_from_probe[:3, 3] = self._center_m(self._places[number], world_from_objects)
        if self._programs.shadows is not None:
            self._programs.shadows.prepare(world_from_probe[:3, 3], world_from_objects)
        self._programs.bind_tables()
        left_out, parts = self._left_out[number], SceneParts.ALL
        if self._has_static_copy(self._places[number]):
            parts = SceneParts.MOVING
            self._copy_static(number, world_from_probe, world_from_objects)
        else:
            self._view.tiles.begin(self._target, [(*self._background, 1.0)])
        self._view.select(left_out, parts)
        self._state.use(self._target, has_depth=True)
        self._own.number = number
        self._view.draw(self._target, world_from_probe, world_from_objects)
        self._maps.draw(number, self._colors, self._depths, self._gloss[number])
        if self._mirrors[number].any():
            self._programs.bind_tables()
            self._view.select(~self._mirrors[number])
            self._state.use(self._target, has_depth=True)
            self._view.add_one_by_one(self._target, world_from_probe, world_from_objects)
            self._maps.draw(number, self._colors, self._depths, self._gloss[number])

    def _has_static_copy(self, place: ProbePlace) -> bool:
        """True if the scene around a probe changes only where moving items are.

        Moving items may cast shadows on static ones.
        """
        is_fixed = place.object_index is None and place.deforming is None
        return is_fixed and self._has_moving and self._programs.shadows is None

    def _copy_static(
        self, number: int, world_from_probe: Floats, world_from_objects: Sequence[Floats]
    ) -> None:
        """Copy the static opaque items, drawn once, into the atlas."""
        atlas = self._colors, self._depths
        if number not in self._static:
            size = self._colors.size
            with gpu_allocation(
                f"{len(self._places)} static copies of reflection probes",
                "make virtual_cameras.reflection_probes smaller",
            ):
                copies = (
                    texture_2d(self._buffers.context, size, 4, dtype="f2"),
                    depth_texture(self._buffers.context, size),
                )
            self._view.select(self._left_out[number], SceneParts.STATIC)
            self._view.tiles.begin(self._target, [(*self._background, 1.0)])
            self._view.draw_opaque(self._target, world_from_probe, world_from_objects)
            copy_textures(dict(zip(atlas, copies, strict=True)))
            self._static[number] = copies
        else:
            copy_textures(dict(zip(self._static[number], atlas, strict=True)))

    def _center_m(self, place: ProbePlace, world_from_objects: Sequence[Floats]) -> Floats:
        """Viewpoint (3,) of a probe, world."""
        center_m = place.center_m
        if place.deforming is not None:
            item = self._buffers.draw_items[place.deforming]
            center_m = item.sphere_at(time_of(world_from_objects)).center
        if place.object_index is None:
            return center_m
        pose = world_from_objects[place.object_index]
        return pose[:3, :3] @ center_m + pose[:3, 3]

    def connect(
        self,
        programs: Collection[SurfaceProgram],
        viewpoint_m: Floats,
        world_from_objects: Sequence[Floats],
    ) -> None:
        """Set the probes of items, relative to a viewpoint (3,), in the programs, and bind them."""
        probes: dict[int, Floats32] = {}
        for number, place in enumerate(self._places):
            center_m = self._center_m(place, world_from_objects) - viewpoint_m
            probe = np.array((*center_m, number), dtype=np.float32)
            probes |= {id(self._buffers.draw_items[index]): probe for index in place.surfaces}
        for program in programs:
            program.set_probes(probes)
        bind_texture(PROBE_UNIT, self._maps.name)


def shared_probes(
    buffers: SceneBuffers,
    programs: SurfacePrograms,
    places: Sequence[ProbePlace],
    background: tuple[float, float, float],
) -> ProbePass:
    """Pass of the probes of a scene, which all cameras share; arguments as of `ProbePass`."""
    passes = programs.shared_passes
    for old in [one for one in passes if one[0] != buffers.version]:
        del passes[old]
    key = buffers.version, len(places), background
    shared = passes.get(key)
    if not isinstance(shared, ProbePass):
        shared = passes[key] = ProbePass(buffers, programs, places, background)
    return shared
