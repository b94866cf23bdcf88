"""Probe pass: the scene as seen from reflection probes, which curved and rough surfaces reflect.

All cameras share the probes. A probe is drawn again if an object has moved or a mesh has deformed
since; its light is therefore a function of the scene and its state alone. Probes of planar mirrors,
and those that are seen within probes, show what is static, and are drawn once.

In a scene of several reflectors, probes are drawn in three turns. In the first, planar metal
mirrors reflect the probe itself, as drawn without them, and other reflective surfaces sky and
lamps. In each later one, surfaces reflect the probes of the turn before.
"""

from __future__ import annotations

import math
import weakref
from collections.abc import Collection, Iterable, Sequence
from enum import Enum
from functools import partial

import moderngl
import numpy as np

from omnisim.core.arrays import Bools, Floats
from omnisim.core.world import time_of
from omnisim.rendering.atlas.tile_plan import TilePlan, cube_plan
from omnisim.rendering.contract import ScenePoses
from omnisim.rendering.opengl.capture.mesh_and_lens import bind_tiles
from omnisim.rendering.opengl.gl.buffers import gpu_allocation
from omnisim.rendering.opengl.gl.framebuffers import attach_layer, framebuffer
from omnisim.rendering.opengl.gl.gpu_textures import (
    bind_texture,
    copy_textures,
    cube_array,
    depth_texture,
    limit_levels,
    texture_2d,
)
from omnisim.rendering.opengl.gl.shader_files import build_program, uniform
from omnisim.rendering.opengl.gl.state import GlState
from omnisim.rendering.opengl.scene_view import SceneParts, SceneView, VirtualCameras
from omnisim.rendering.opengl.surfaces.scene_drawer import SkyPass
from omnisim.rendering.opengl.surfaces.surface_program import (
    Probe,
    SurfaceProgram,
    SurfacePrograms,
)
from omnisim.rendering.opengl.world.scene_buffers import SceneBuffers
from omnisim.scene.parts import Material
from omnisim.scene.reflection_probes import ProbePlace
from omnisim.scene.surface_kind import SurfaceKind, lobe_roughnesses
from omnisim.scene.surface_reflectance import MIN_ROUGHNESS

SIZE_PX, PLANAR_SIZE_PX = 128, 256  # of a face, of planar mirrors and panes
_BOUNCES = 2  # turns before the last
_AWAY = np.eye(4)  # pose at which an object is not seen, and casts no shadow
_AWAY[:3, 3] = 1e7
_METAL = 0.5  # metalness from which a surface shows reflections alone
_NEAR_SHARE, _MAX_NEAR_M = 0.05, 0.05  # near plane, as a share of the smallest probe's radius
_LEVELS = 6
# Squared roughness of each level, as in shaders/scene/reflection_probe.glsl.
_ALPHAS = (0.0, *(0.024 * 2.0**level for level in range(_LEVELS - 1)))
_FACES = 6
_MIN_ROUGH = 0.25  # roughness from which level 2 and further ones are looked up
# Steps toward a hit and refinements of it: of bodies and smooth mirrors among other reflectors,
# and of all others.
_MORE_STEPS, _STEPS = (10, 2), (4, 2)
_COLORS_UNIT, _DEPTHS_UNIT, _CUBES_UNIT = 0, 1, 0
# Lobes of two levels add up between linearly and by their squares.
_POWER = 1.5


class _OwnProbe:
    """Probe from whose viewpoint the scene is drawn, for the planar metal mirrors within it.

    Attributes:
        items: indices of the mirrors' items.
        planar: see `SceneProbes`; none have other probes.
        number: index of the probe's cube.
    """

    def __init__(self, buffers: SceneBuffers, name: int):
        items, self.number, self._name = buffers.draw_items, 0, name
        planar = {index for plane in buffers.mirrors for index in plane.parts}
        self.items = frozenset(index for index in planar if items[index].material.metallic > _METAL)
        self.planar = frozenset[int]()
        self._items = [items[index] for index in self.items]

    def render(self, seen: Collection[int], world_from_objects: Sequence[Floats]) -> None:
        """Do nothing: it has been drawn without them."""

    def connect(self, programs: Collection[SurfaceProgram], shot: ScenePoses) -> None:
        """Set the probe of the mirrors, whose center is the viewpoint."""
        place = np.array((0.0, 0.0, 0.0, self.number), dtype=np.float32)
        probe = Probe(place, _STEPS, self._name)
        for program in programs:
            program.set_probes({id(item): probe for item in self._items})


class ProbePass:
    """Draws the reflection probes of a scene; invalid once the buffers have changed.

    Args:
        buffers: scene and dynamic objects.
        programs: surface programs for the scene's lights.
        places: probes to draw.
        background: linear RGB of rays that hit nothing.
        within: probes that surfaces within these reflect; None: see the module.
        is_static: the probes show what is static.
        size_px: texels across a face.

    Attributes:
        items: indices of the items that reflect a probe.
        planar: indices of those that are planar mirrors or panes.

    Raises:
        GraphicsError: the probes do not fit on the GPU.
    """

    def __init__(
        self,
        buffers: SceneBuffers,
        programs: SurfacePrograms,
        places: Sequence[ProbePlace],
        background: tuple[float, float, float],
        within: ProbePass | None = None,
        is_static: bool = False,
        size_px: int = SIZE_PX,
    ):
        context = buffers.context
        self._buffers, self._programs, self._places = buffers, programs, places
        self._within = within
        self._background = background
        plan = cube_plan(size_px)
        size = plan.width_px, plan.height_px
        near_m = min(_MAX_NEAR_M, _NEAR_SHARE * min(place.radius_m for place in places))
        with gpu_allocation(f"an atlas of {size[0]} × {size[1]} px", "free GPU memory"):
            self._colors = texture_2d(context, size, 4, dtype="f2")
            self._depths = depth_texture(context, size)
        self._target = framebuffer(context, [self._colors], self._depths)
        self._maps = _ProbeMaps(context, plan, near_m, len(places))
        self._own = _OwnProbe(buffers, self._maps.name)
        self._is_mirror = self._mask(self._own.items if within is None else ())
        cameras = VirtualCameras(near_m, math.inf, background=background, mirrors=0)
        sky = programs.sky_seen(False)
        behind = None if sky is None else SkyPass(context, sky, plan)
        self._view = SceneView(
            buffers, programs, plan, cameras, self._depths, 1, behind, probes=within or self._own
        )
        self.items = frozenset(index for place in places for index in place.surfaces)
        self.planar = frozenset(i for place in places if place.is_planar for i in place.surfaces)
        self._is_static = is_static
        left_out = self._is_mirror
        if is_static:  # blended items are not selected by their motion
            left_out = left_out | ~SceneParts.STATIC.mask(buffers.draw_items)
        self._left_out = [self._mask(place.left_out) | left_out for place in places]
        self._mirrors = [self._is_mirror & ~self._mask(place.left_out) for place in places]
        items = buffers.draw_items
        self._steps = [self._steps_of(place) for place in places]
        self._gloss = [
            _Gloss.of(items[surface].material for surface in place.surfaces) for place in places
        ]
        self._states: list[bytes | None] = [None] * len(places)
        self._static: dict[int, tuple[moderngl.Texture, moderngl.Texture]] = {}
        self._has_moving = any(item.moves for item in buffers.draw_items)
        self._state = GlState()

    def _steps_of(self, place: ProbePlace) -> tuple[int, int]:
        kinds = [self._buffers.draw_items[index].kind for index in place.surfaces]
        is_smooth = not place.is_planar or any(SurfaceKind.MIRROR in kind for kind in kinds)
        is_pane = all(SurfaceKind.PANE in kind for kind in kinds)
        return _MORE_STEPS if self._within is not None and is_smooth and not is_pane else _STEPS

    def _mask(self, left_out: Collection[int]) -> Bools:
        mask = np.zeros(len(self._buffers.draw_items), dtype=np.bool_)
        mask[list(left_out)] = True
        return mask

    def render(self, seen: Collection[int], world_from_objects: Sequence[Floats]) -> None:
        """Render the probes that items at the given indices reflect; meshes are deformed."""
        state = b"".join(np.asarray(pose).tobytes() for pose in world_from_objects)
        if self._buffers.deforming.size:
            state += np.float64(time_of(world_from_objects)).tobytes()
        # meshes that deform cast shadows on static ones, and cannot be moved away
        casts = bool(self._buffers.deforming.size) and self._programs.shadows is not None
        poses = world_from_objects
        if self._is_static and not casts:
            state, poses = b"", [_AWAY] * len(world_from_objects)
        for number, place in enumerate(self._places):
            if self._states[number] == state or place.surfaces.isdisjoint(seen):
                continue
            if self._within is not None:
                self._within.render(self._within.items, world_from_objects)
            self._draw(number, poses)
            self._states[number] = state

    def _draw(self, number: int, world_from_objects: Sequence[Floats]) -> None:
        world_from_probe = np.eye(4)
        world_from_probe[:3, 3] = self._center_m(self._places[number], world_from_objects)
        shot = ScenePoses(world_from_probe, world_from_objects)
        if self._programs.shadows is not None:
            self._programs.shadows.prepare(shot.viewpoint_m, world_from_objects)
        self._programs.bind_tables()
        left_out, parts, place = self._left_out[number], SceneParts.ALL, self._places[number]
        is_fixed = place.object_index is None and place.deforming is None
        if self._is_static:
            parts, is_fixed = SceneParts.STATIC, False
        # moving items may cast shadows on static ones
        if is_fixed and self._has_moving and self._programs.shadows is None:
            parts = SceneParts.MOVING
            self._copy_static(number, shot)
        else:
            self._view.tiles.begin(self._target, [(*self._background, 1.0)])
        self._view.select(left_out, parts)
        self._state.use(self._target, has_depth=True)
        self._own.number = number
        self._view.draw(self._target, (shot,))
        self._maps.draw(number, self._colors, self._depths, self._gloss[number])
        if self._mirrors[number].any():
            self._programs.bind_tables()
            self._view.select(~self._mirrors[number])
            self._state.use(self._target, has_depth=True)
            self._view.add_one_by_one(self._target, shot)
            self._maps.draw(number, self._colors, self._depths, self._gloss[number])

    def _copy_static(self, number: int, shot: ScenePoses) -> None:
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
            self._view.draw_opaque(self._target, shot)
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

    def connect(self, programs: Collection[SurfaceProgram], shot: ScenePoses) -> None:
        """Set the probes of items in the programs for a viewpoint."""
        for program in programs:
            program.set_probes(self.at(shot))

    def at(self, shot: ScenePoses) -> dict[int, Probe]:
        """Probes of items, see `SurfaceProgram.set_probes`."""
        probes: dict[int, Probe] = {}
        for number, place in enumerate(self._places):
            center_m = self._center_m(place, shot.world_from_objects) - shot.viewpoint_m
            at_m = np.array((*center_m, number), dtype=np.float32)
            probe = Probe(at_m, self._steps[number], self._maps.name)
            probes |= {id(self._buffers.draw_items[index]): probe for index in place.surfaces}
        return probes


class SceneProbes:
    """All probes of a scene; arguments as of `ProbePass`.

    Attributes:
        items: indices of the items that reflect a probe.
        planar: indices of those that are planar mirrors or panes.
    """

    def __init__(
        self,
        buffers: SceneBuffers,
        programs: SurfacePrograms,
        places: Sequence[ProbePlace],
        background: tuple[float, float, float],
    ):
        planar = [place for place in places if place.is_planar]
        others = [place for place in places if not place.is_planar]
        make = partial(ProbePass, buffers, programs, background=background)
        within: ProbePass | None = None
        if len(places) > 1:
            fixed = [
                place for place in places if place.object_index is None and place.deforming is None
            ]
            for _ in range(_BOUNCES if fixed else 0):
                within = make(fixed, within=within, is_static=True)
        self._passes = [make(others, within=within)] if others else []
        if planar:
            self._passes.append(make(planar, within=within, is_static=True, size_px=PLANAR_SIZE_PX))
        self.items = frozenset(index for probes in self._passes for index in probes.items)
        self.planar = frozenset(index for probes in self._passes for index in probes.planar)

    def render(self, seen: Collection[int], world_from_objects: Sequence[Floats]) -> None:
        """Render the probes that items at the given indices reflect; meshes are deformed."""
        for probes in self._passes:
            probes.render(seen, world_from_objects)

    def connect(self, programs: Collection[SurfaceProgram], shot: ScenePoses) -> None:
        """Set the probes of items in the programs for a viewpoint."""
        probes = {key: probe for some in self._passes for key, probe in some.at(shot).items()}
        for program in programs:
            program.set_probes(probes)


def shared_probes(
    buffers: SceneBuffers,
    programs: SurfacePrograms,
    places: Sequence[ProbePlace],
    background: tuple[float, float, float],
) -> SceneProbes:
    """Probes of a scene, which all cameras share; arguments as of `ProbePass`."""
    passes = programs.shared_passes
    for old in [key for key in passes if key[0] != buffers.version]:
        del passes[old]
    key = buffers.version, tuple(places), background
    shared = passes.get(key)
    if not isinstance(shared, SceneProbes):
        shared = passes[key] = SceneProbes(buffers, programs, places, background)
    return shared


class _Gloss(Enum):
    """Numbers of samples of level 1, and of each further level, by the gloss of a probe's surfaces.

    Levels of perfect mirrors filter small reflections. Level 1 is looked up by smooth gloss, where
    its samples would be visible beside bright lamps.
    """

    MIRROR = (4, 4)
    SMOOTH = (48, 32)
    ROUGH = (12, 24)

    @classmethod
    def of(cls, materials: Iterable[Material]) -> _Gloss:
        """Gloss of surfaces of the given materials."""
        roughnesses = [value for material in materials for value in lobe_roughnesses(material)]
        rough = [roughness for roughness in roughnesses if roughness > MIN_ROUGHNESS]
        if not rough:
            return cls.MIRROR
        return cls.SMOOTH if min(rough) < _MIN_ROUGH else cls.ROUGH


class _ProbeMaps:
    """Array of cube maps: light and inverse distance, then light filtered for roughness.

    Args:
        plan: atlas of six whole faces that probes are drawn into.
        near_m: near plane of the atlas's depth.
        cubes: number of probes.

    Attributes:
        name: OpenGL's name of the texture.
    """

    def __init__(self, context: moderngl.Context, plan: TilePlan, near_m: float, cubes: int):
        self._size_px, self._state = plan.tiles[0].face_size_px, GlState()
        with gpu_allocation(
            f"{cubes} reflection probes of {self._size_px} px",
            "make virtual_cameras.reflection_probes smaller",
        ):
            self.name = cube_array(context, self._size_px, _LEVELS, cubes)
            attached = texture_2d(context, (1, 1), 4, dtype="f2")  # until a face is
        dropped = weakref.finalize(self, context.extra.dropped_textures.append, self.name)
        dropped.atexit = False  # the end of the process frees it
        self._target = framebuffer(context, [attached])
        self._faces = build_program(context, "common/full_screen.vert", "scene/probe_face.frag")
        bind_tiles(self._faces, plan, np.eye(3))
        uniform(self._faces, "u_colors").value = _COLORS_UNIT
        uniform(self._faces, "u_depths").value = _DEPTHS_UNIT
        uniform(self._faces, "u_near_m").value = near_m
        self._gloss = build_program(context, "common/full_screen.vert", "scene/probe_gloss.frag")
        uniform(self._gloss, "u_cubes").value = _CUBES_UNIT
        self._face_triangle = context.vertex_array(self._faces, [])
        self._gloss_triangle = context.vertex_array(self._gloss, [])

    def draw(
        self, cube: int, colors: moderngl.Texture, depths: moderngl.Texture, gloss: _Gloss
    ) -> None:
        """Copy a probe from its atlas, and filter its levels.

        Args:
            cube: index of the probe.
            colors, depths: atlas.
            gloss: gloss of its surfaces.
        """
        colors.use(_COLORS_UNIT)
        depths.use(_DEPTHS_UNIT)
        self._draw_level(cube, 0, self._faces, self._face_triangle)
        bind_texture(_CUBES_UNIT, self.name)
        uniform(self._gloss, "u_cube").value = float(cube)
        for level in range(1, _LEVELS):
            uniform(self._gloss, "u_facets").value = gloss.value[level > 1]
            between = (_ALPHAS[level] ** _POWER - _ALPHAS[level - 1] ** _POWER) ** (1.0 / _POWER)
            uniform(self._gloss, "u_alpha").value = between
            limit_levels(self.name, level - 1, level - 1)
            self._draw_level(cube, level, self._gloss, self._gloss_triangle)
        limit_levels(self.name, 0, _LEVELS - 1)

    def _draw_level(
        self, cube: int, level: int, program: moderngl.Program, triangle: moderngl.VertexArray
    ) -> None:
        size_px = self._size_px >> level
        uniform(program, "u_texel").value = 1.0 / size_px
        for face in range(_FACES):
            attach_layer(self._target.glo, self.name, _FACES * cube + face, level=level)
            self._state.use(self._target)
            uniform(program, "u_face").value = face
            with self._state.within_rectangles(self._target) as aim:
                aim(0, 0, size_px, size_px)
                triangle.render(moderngl.TRIANGLES, vertices=3)
