"""Back end of virtual cameras: OpenGL renders cube faces, and samples images from them."""

from __future__ import annotations

import threading
import weakref
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Generic, TypeVar

from omnisim.cameras import NonCentralCamera
from omnisim.core.arrays import Floats
from omnisim.core.errors import GraphicsError
from omnisim.core.world import ObjectPart, Poses
from omnisim.rendering.camera.quality import near_plane_m, scene_size_m
from omnisim.rendering.contract import (
    BeamCaster,
    CameraBackend,
    CameraSetup,
    RangeFinder,
    SceneBackend,
    SceneRays,
)
from omnisim.rendering.opengl.gl.context import (
    check_process,
    collect_garbage,
    current,
    graphics_info,
    open_context,
    release_context,
    release_unclosed_context,
    release_unclosed_contexts,
)
from omnisim.rendering.opengl.opengl_camera import CubeCamera, DrawnScene
from omnisim.rendering.opengl.shadows.shadow_maps import ShadowMaps
from omnisim.rendering.opengl.surfaces.surface_program import SurfacePrograms
from omnisim.rendering.opengl.world.scene_buffers import SceneBuffers
from omnisim.scene import Scene
from omnisim.scene.surface_kind import SurfaceKind, kind_of

if TYPE_CHECKING:  # imported where they are made: few images need them
    from omnisim.ground_truth.hits import BeamHits, LidarBeams, Revolution, ScanBeams

LIDAR_NEAR_M = 0.01  # smaller in small scenes


class CubeBackend(SceneBackend):
    """OpenGL context with one copy of the scene and the programs that draw it.

    A back end that is dropped without `close` warns, as files do, and is released.

    Args:
        scene: static scene.
        objects: bodies and dynamic objects by name.
        device: number of the GPU, as `omnisim info` lists them, or cuda:N; None takes the first.
        open_rays: function that opens rays at a scene and its objects, for what is not drawn.

    Attributes:
        context, buffers, surface_programs: OpenGL context, scene and programs of all passes.

    Raises:
        GraphicsError: no OpenGL, OpenGL too old, or a scene beyond its limits.
    """

    def __init__(
        self,
        scene: Scene,
        objects: Mapping[str, Scene],
        device: int | str | None,
        open_rays: Callable[[Scene, Sequence[Scene]], SceneRays],
    ):
        super().__init__(scene, objects)
        self._open_rays = open_rays
        self._rays: SceneRays | None = None
        self.context = open_context(device)
        self._finalizer = weakref.finalize(
            self, release_unclosed_context, self.context, threading.current_thread()
        )
        self._finalizer.atexit = False  # the end of the process frees it
        try:
            with self.context:  # current since it was opened, and not afterwards
                self.buffers = SceneBuffers(self.context, scene, tuple(objects.values()))
                self._shadows = None
                if has_computed_shadows((scene, *objects.values())):
                    self._shadows = ShadowMaps(self.buffers, scene.lighting)
                self.surface_programs = SurfacePrograms(self.buffers, scene.lighting, self._shadows)
        except BaseException:
            self.close()
            raise

    @property
    def is_open(self) -> bool:
        """False after `close`."""
        return self._finalizer.alive

    @property
    def renderer(self) -> str:
        """OpenGL's name of the renderer."""
        return graphics_info(self.context).renderer

    @contextmanager
    def current(self) -> Iterator[None]:
        """Make its context current for a `with` block.

        Raises:
            GraphicsError: the back end is closed, or belongs to the process before a fork.
        """
        check_process()
        if not self.is_open:
            raise GraphicsError("this stage is closed: open a new one")
        release_unclosed_contexts()
        with current(self.context):
            collect_garbage(self.context)  # renderers that were dropped without `close`
            yield

    def update(self, scene: Scene) -> None:
        """Replace the static scene, with the context current. Unchanged meshes are not uploaded."""
        self.buffers.update(scene)
        if self._shadows is not None:
            self._shadows.refresh()
        self.scene = scene
        if self._rays is not None:
            self._rays.update(scene)

    @property
    def rays(self) -> SceneRays:
        """Rays at the scene, opened on first use."""
        if self._rays is None:
            self._rays = self._open_rays(self.scene, tuple(self.objects.values()))
        return self._rays

    def camera(self, setup: CameraSetup) -> CameraBackend:
        """Camera in the scene; needs the current context, as do all its methods."""
        drawn = DrawnScene(self.buffers, self.surface_programs)
        if isinstance(setup.sensor.model, NonCentralCamera):
            from omnisim.rendering.opengl.parallax_camera import ParallaxCamera  # seldom needed

            return ParallaxCamera(self, drawn, setup)
        return CubeCamera(self, drawn, setup)

    def range_finder(self, beams: ScanBeams, hidden: frozenset[ObjectPart]) -> RangeFinder:
        """Beams of a scanner; needs the current context, as do the pass's methods."""
        from omnisim.rendering.opengl.hits.range_pass import RangePass

        def draw() -> RangePass:
            return RangePass(self.buffers, beams.angles_rad, beams.max_range_m, hidden)

        if beams.echo_limits is None:
            return draw()
        return _FollowedRanges(
            self.follows_specular, draw, lambda: self.rays.range_finder(beams, hidden)
        )

    def beam_caster(self, beams: LidarBeams, hidden: frozenset[ObjectPart]) -> BeamCaster:
        """Beams of a spinning lidar; needs the current context, as do the pass's methods."""
        from omnisim.rendering.opengl.hits.lidar_beams import LidarPass

        near_m = near_plane_m(scene_size_m(self.scene), LIDAR_NEAR_M)

        def draw() -> LidarPass:
            return LidarPass(self.buffers, beams, near_m, hidden, self.rays)

        if beams.echo_limits is None:
            return draw()
        return _FollowedBeams(
            self.follows_specular, draw, lambda: self.rays.beam_caster(beams, hidden)
        )

    def close(self) -> None:
        """Release the OpenGL context and everything in it."""
        if self._finalizer.detach() is not None:
            for name in ("buffers", "surface_programs", "_shadows", "_rays"):
                self.__dict__.pop(name, None)
            release_context(self.context)


CasterT = TypeVar("CasterT", bound=RangeFinder | BeamCaster)


class _Followed(Generic[CasterT]):
    """Caster by virtual cameras (`draw`) or rays (`cast`), as the scene needs after each edit."""

    def __init__(
        self, follows: Callable[[], bool], draw: Callable[[], CasterT], cast: Callable[[], CasterT]
    ):
        self._follows, self._draw, self._cast = follows, draw, cast
        self._is_cast = follows()
        self._caster = cast() if self._is_cast else draw()

    def refresh(self) -> None:
        """Adapt to the scene after its objects or buffers have changed."""
        is_cast = self._follows()
        if is_cast == self._is_cast:
            self._caster.refresh()
            return
        self._is_cast = is_cast
        self._caster = self._cast() if is_cast else self._draw()


class _FollowedRanges(_Followed[RangeFinder]):
    """Beams of a scanner."""

    def cast(self, world_from_scanner: Floats, world_from_objects: Poses = ()) -> Floats:
        """Ranges (n,) in m from a pose (4, 4), with the objects at their poses; +inf: no hit."""
        return self._caster.cast(world_from_scanner, world_from_objects)


class _FollowedBeams(_Followed[BeamCaster]):
    """Beams of a spinning lidar."""

    @property
    def draws(self) -> Sequence[ObjectPart]:
        """Dynamic object and name of each instance, indexed by `BeamHits.draw_ids` − 1."""
        return self._caster.draws

    def cast(self, revolution: Revolution) -> BeamHits:
        """Hits of all beams of a revolution."""
        return self._caster.cast(revolution)


def has_computed_shadows(parts: Sequence[Scene]) -> bool:
    """Tell whether lamps cast shadows on the scene (the first part) or on dynamic objects.

    Baked light includes its shadows; beside it they are for glossy surfaces.
    """
    lighting = parts[0].lighting
    if lighting.baked is None:
        return lighting.has_shadows
    kinds = [kind_of(material, lighting.is_matte) for part in parts for material in part.materials]
    return lighting.has_shadows and not all(SurfaceKind.MATTE in kind for kind in kinds)
