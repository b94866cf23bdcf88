"""Parts of a frame: their times, and counts of what is drawn.

No other module of the benchmarks depends on the structure of a `Renderer`. The pipeline calls
`CubeCamera.cube` to draw the virtual cameras. The work from there to the first read from the GPU is
the mirror pass and the capture; the reads are the readback. Reads and draws are patched in
moderngl, so it does not matter how the pipeline calls them.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import partial, wraps
from typing import Any, NamedTuple

import moderngl
import numpy as np
from numpy.typing import NDArray

from benchmarks.gl_counters import Counts, count
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.contract import CameraBackend
from omnisim.rendering.opengl.culling.cluster_culling import BANDS
from omnisim.rendering.opengl.gl.buffers import read_buffer
from omnisim.rendering.opengl.gl.pixel_readback import PixelReadback, PixelReading
from omnisim.rendering.opengl.opengl_camera import CubeCamera
from omnisim.rendering.opengl.surfaces.cluster_drawer import ClusterDrawer
from omnisim.rendering.renderer import Renderer
from omnisim.rendering.stage import Stage

_READS = (
    (PixelReadback, ("start",)),
    (PixelReading, ("finish",)),
)


class PartSeconds(NamedTuple):
    """Seconds of a frame's parts, each including its work on the GPU."""

    virtual_cameras: float  # the faces of the cube
    capture: float  # mirror pass, averaging, encoding
    readback: float
    around: float  # Python's work before, between and after

    @property
    def whole(self) -> float:
        """Seconds of the frame, with a wait for the GPU at each boundary."""
        return sum(self)


@dataclass(frozen=True)
class FrameCounts:
    """Numbers of draws in a frame.

    Attributes:
        virtual_cameras: pipeline statistics of the faces.
        calls: number of draw calls from Python.
        draws: number of draws in these calls; one call draws many clusters.
    """

    virtual_cameras: Counts
    calls: int
    draws: int


class RepeatedFrame:
    """One renderer's frame from one pose, repeatable.

    Args:
        renderer: renderer of an ideal camera.
        world_from_base: (4, 4) pose of the vehicle.
    """

    def __init__(self, renderer: Renderer, world_from_base: NDArray[np.float64]):
        self.renderer, self.world_from_base = renderer, world_from_base

    @classmethod
    def at_start(cls, stage: Stage, camera: OmniCamera) -> RepeatedFrame:
        """Frame from the scene's start pose."""
        start = stage.scene.start
        return cls(stage.open(camera), camera.base_pose(start.position_m, yaw_deg=start.yaw_deg))

    def render(self) -> NDArray[np.uint8]:
        """Render the image (height, width, 4), and wait for it."""
        return self.renderer.render(self.world_from_base).rgba

    def render_faces(self) -> None:
        """Draw the virtual cameras alone, and wait for the GPU."""
        with self.renderer._current() as passes:  # not nested: the inner end would be the outer's
            self._draw_faces(passes)
            self.renderer._stage.context.finish()

    def parts(self) -> PartSeconds:
        """Render, wait for the GPU at every boundary, and time each part."""
        marks = _Marks(self.renderer._stage.context)
        with self.renderer._current() as passes:
            assert isinstance(passes, CubeCamera)
            cube = passes.cube
        start = time.perf_counter()
        with _patched(cube, "draw", marks.faces), _reads(marks.read):
            self.render()
        whole = time.perf_counter() - start
        faces, capture, reads = marks.seconds
        return PartSeconds(faces, capture, reads, whole - faces - capture - reads)

    def count(self) -> FrameCounts:
        """Render, and count the draws."""
        with self.renderer._current() as passes:
            counted = count(self.renderer._stage.context, lambda: self._draw_faces(passes))
        calls: list[int] = []

        def noting(draw: Callable[..., Any]) -> Callable[..., Any]:
            @wraps(draw)
            def noted(*arguments: Any, **options: Any) -> Any:
                calls.append(1)
                return draw(*arguments, **options)

            return noted

        with (
            _patched(moderngl.VertexArray, "render", noting),
            _patched(ClusterDrawer, "draw", partial(_noting_clusters, calls)),
        ):
            self.render()
        return FrameCounts(counted, len(calls), sum(calls))

    def _draw_faces(self, passes: CameraBackend) -> None:
        renderer = self.renderer
        assert isinstance(passes, CubeCamera)
        passes.cube.draw((renderer._poses_in(renderer._state(self.world_from_base)),))


class _Marks:
    """Sums of the times between the boundaries of a frame's parts."""

    def __init__(self, context: moderngl.Context):
        self._context = context
        self._faces = self._capture = self._reads = 0.0
        self._faces_end: float | None = None

    @property
    def seconds(self) -> tuple[float, float, float]:
        """Seconds of faces, capture and reads."""
        return self._faces, self._capture, self._reads

    def faces(self, render: Callable[..., Any]) -> Callable[..., Any]:
        """Function that draws the faces, timed."""

        @wraps(render)
        def timed(*arguments: Any, **options: Any) -> Any:
            self._context.finish()
            start = time.perf_counter()
            drawn = render(*arguments, **options)
            self._context.finish()
            self._faces_end = time.perf_counter()
            self._faces += self._faces_end - start
            return drawn

        return timed

    def read(self, read: Callable[..., Any]) -> Callable[..., Any]:
        """Read function, timed; its wait for the GPU counts as capture."""

        @wraps(read)
        def timed(*arguments: Any, **options: Any) -> Any:
            self._context.finish()
            start = time.perf_counter()
            if self._faces_end is not None:
                self._capture += start - self._faces_end
                self._faces_end = None
            values = read(*arguments, **options)
            self._reads += time.perf_counter() - start
            return values

        return timed


@contextmanager
def _patched(
    owner: Any, name: str, change: Callable[[Callable[..., Any]], Callable[..., Any]]
) -> Iterator[None]:
    """Patch a function of an object or a class during a `with` block."""
    is_own = name in vars(owner)
    original = getattr(owner, name)
    setattr(owner, name, change(original))
    try:
        yield
    finally:
        if is_own:
            setattr(owner, name, original)
        else:
            delattr(owner, name)


@contextmanager
def _reads(change: Callable[[Callable[..., Any]], Callable[..., Any]]) -> Iterator[None]:
    """Patch all functions that read from the GPU."""
    with ExitStack() as stack:
        for owner, names in _READS:
            for name in names:
                stack.enter_context(_patched(owner, name, change))
        yield


def _noting_clusters(
    calls: list[int], draw: Callable[[ClusterDrawer, int], None]
) -> Callable[[ClusterDrawer, int], None]:
    """Function that draws clusters, and records the number of draws per call, read from the GPU."""

    @wraps(draw)
    def noted(drawer: ClusterDrawer, pass_index: int) -> None:
        draw(drawer, pass_index)
        counts = np.frombuffer(read_buffer(drawer.culler.counts), dtype=np.uint32)
        length = BANDS * drawer.culler.ranges
        calls.extend(counts[pass_index * length : (pass_index + 1) * length].tolist())

    return noted
