"""Back end of virtual cameras: OpenGL renders cube faces, and samples images from them."""

from __future__ import annotations

import threading
import weakref
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING

from omnisim.cameras import NonCentralCamera
from omnisim.core.arrays import Floats
from omnisim.core.errors import GraphicsError
from omnisim.core.world import ObjectPart
from omnisim.rendering.camera.quality import near_plane_m, scene_size_m
from omnisim.rendering.contract import (
    BeamCaster,
    CameraBackend,
    CameraSetup,
    RangeFinder,
    SceneBackend,
)
from omnisim.rendering.opengl.drawing.surface_program import SurfacePrograms
from omnisim.rendering.opengl.geometry.scene_buffers import SceneBuffers
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
from omnisim.scene import Scene
from omnisim.scene.surface_kind import SurfaceKind, kind_of

if TYPE_CHECKING:  # imported where they are made: few images need them
    from omnisim.ground_truth.lidar_beams import EchoLimits, LidarBeams
    from omnisim.rendering.rays.ray_scene import RayScene

LIDAR_NEAR_M = 0.01  # smaller in small scenes


class CubeBackend(SceneBackend):
    """OpenGL context with one copy of the scene and the programs that draw it.

    A back end that is dropped without `close` warns, as files do, and is released.

    Args:
        scene: static scene.
        objects: bodies and dynamic objects by name.
        device: number of the GPU, as `omnisim info` lists them, or cuda:N; None takes the first.

    Attributes:
        context, buffers, surface_programs: OpenGL context, scene and programs of all passes.

    Raises:
        GraphicsError: no OpenGL, OpenGL too old, or a scene beyond its limits.
    """

    def __init__(self, scene: Scene, objects: Mapping[str, Scene], device: int | str | None = None):
        super().__init__(scene, objects)
        self._rays: RayScene | None = None
        self._surfaces: RayScene | None = None
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
        self.scene, self._rays, self._surfaces = scene, None, None

    def camera(self, setup: CameraSetup) -> CameraBackend:
        """Camera in the scene; needs the current context, as do all its methods."""
        drawn = DrawnScene(self.buffers, self.surface_programs)
        if isinstance(setup.sensor.model, NonCentralCamera):
            from omnisim.rendering.opengl.parallax_camera import ParallaxCamera  # seldom needed

            return ParallaxCamera(self, drawn, setup)
        return CubeCamera(self, drawn, setup)

    def range_finder(
        self,
        angles_rad: Floats,
        max_range_m: float,
        hidden: frozenset[ObjectPart],
        limits: EchoLimits | None = None,
    ) -> RangeFinder:
        """Beams of a scanner; needs the current context, as do the pass's methods."""
        from omnisim.rendering.opengl.drawing.range_pass import RangePass
        from omnisim.rendering.rays.beams import Beams
        from omnisim.rendering.rays.followed_beams import FollowedRanges

        def drawn() -> RangePass:
            return RangePass(self.buffers, angles_rad, max_range_m, hidden)

        if limits is None:
            return drawn()
        return FollowedRanges(
            self.follows_specular,
            drawn,
            lambda: Beams(self.ray_scene, angles_rad, max_range_m, hidden, limits),
        )

    def beam_caster(self, beams: LidarBeams, hidden: frozenset[ObjectPart]) -> BeamCaster:
        """Beams of a spinning lidar; needs the current context, as do the pass's methods."""
        from omnisim.rendering.opengl.ground_truth.lidar_pass import LidarPass
        from omnisim.rendering.rays.beams import LidarCaster
        from omnisim.rendering.rays.followed_beams import FollowedBeams

        near_m = near_plane_m(scene_size_m(self.scene), LIDAR_NEAR_M)

        def drawn() -> LidarCaster:
            geometry = lambda: self.surfaces().caster.geometry  # noqa: E731 - as it is at the time
            cameras = LidarPass(self.buffers, beams, near_m, hidden, geometry)
            return LidarCaster(self.surfaces, beams, hidden, cameras)

        if beams.echo_limits is None:
            return drawn()
        return FollowedBeams(
            self.follows_specular, drawn, lambda: LidarCaster(self.ray_scene, beams, hidden)
        )

    def surfaces(self) -> RayScene:
        """Scene whose surfaces can be looked up; only a built `ray_scene` can cast, too."""
        if self._surfaces is None:
            from omnisim.rendering.rays.ray_scene import RayScene  # seldom needed

            objects = tuple(self.objects.values())
            self._surfaces = self._rays or RayScene(self.scene, objects, casts=False)
        return self._surfaces

    def ray_scene(self) -> RayScene:
        """Scene to cast rays at, built on first use after an edit.

        Raises:
            OmnisimError: embreex is not installed.
        """
        if self._rays is None:
            from omnisim.rendering.rays.ray_scene import RayScene  # needs an extra

            self._rays = RayScene(self.scene, tuple(self.objects.values()))
        return self._rays

    def close(self) -> None:
        """Release the OpenGL context and everything in it."""
        if self._finalizer.detach() is not None:
            for name in ("buffers", "surface_programs", "_shadows", "_rays", "_surfaces"):
                self.__dict__.pop(name, None)
            release_context(self.context)


def has_computed_shadows(parts: Sequence[Scene]) -> bool:
    """Tell whether lamps cast shadows on the scene (the first part) or on dynamic objects.

    Baked light includes its shadows; beside it they are for glossy surfaces.
    """
    lighting = parts[0].lighting
    if lighting.baked is None:
        return lighting.has_shadows
    kinds = [kind_of(one, lighting.is_matte) for part in parts for one in part.materials]
    return lighting.has_shadows and not all(SurfaceKind.MATTE in kind for kind in kinds)
