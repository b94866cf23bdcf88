"""A laser scanner in a scene: poses in, scans out."""

from __future__ import annotations

from types import TracebackType

import numpy as np
from numpy.typing import ArrayLike

from omnisim import __version__
from omnisim.errors import GraphicsError
from omnisim.frames import check_pose
from omnisim.gpu.context import open_context
from omnisim.gpu.range_pass import RangePass
from omnisim.gpu.scene_buffers import SceneBuffers
from omnisim.scene import Scene
from omnisim.sensors.laser_scanner import LaserScanner
from omnisim.sensors.scan import Scan


class LaserRenderer:
    """Takes a scanner's scans of a scene; loads and compiles everything once.

    Use it as a context manager, or `close` it: it holds an OpenGL context.

    Args:
        scene: what there is to hit.
        scanner: by default an LMS200.
        device: EGL's number of the GPU, as `omnisim info` lists them; None takes the first.
        buffers: of the scene, where a camera's renderer has them already. The scanner then shares
            their context; whoever opened it closes it, after this renderer's last scan.

    Raises:
        GraphicsError: no OpenGL, too old an OpenGL, or a scene past its limits.
    """

    def __init__(
        self,
        scene: Scene,
        scanner: LaserScanner | None = None,
        *,
        device: int | None = None,
        buffers: SceneBuffers | None = None,
    ):
        self.scene = scene
        self.scanner = LaserScanner() if scanner is None else scanner
        self._angles_rad = np.radians(self.scanner.angles_deg)
        self._closed, self._is_context_ours = False, buffers is None
        self._context = open_context(device) if buffers is None else buffers.context
        try:
            with self._context:
                self._ranges = RangePass(
                    self._context,
                    SceneBuffers(self._context, scene) if buffers is None else buffers,
                    self._angles_rad,
                    self.scanner.reach_m,
                )
        except BaseException:
            self.close()
            raise

    def scan(self, world_from_scanner: ArrayLike, scan_number: int = 0) -> Scan:
        """Take one scan.

        Args:
            world_from_scanner: (4, 4) pose of the scanner, see `omnisim.frames.pose`.
            scan_number: of the drive; the noise depends on it and on the scanner's seed alone.

        Raises:
            OmnisimError: a matrix that is not a pose, a number that is none, or the renderer is
                closed.
        """
        if self._closed:
            raise GraphicsError("this renderer is closed: open a new one")
        pose = check_pose(world_from_scanner)
        with self._context:  # another renderer's may be current
            true_ranges_m = self._ranges.cast(pose)
        ranges_m = self.scanner.measure(true_ranges_m, scan_number)
        metadata = {
            "omnisim": __version__,
            "scene": self.scene.name,
            "scan_number": int(scan_number),
        }
        return Scan(self._angles_rad, ranges_m, self.scanner, pose, metadata)

    def close(self) -> None:
        """Give the OpenGL context back if it is its own; of no use afterwards."""
        if not self._closed:
            self._closed = True
            if self._is_context_ours:
                self._context.release()

    def __enter__(self) -> LaserRenderer:
        """Enter a `with` block."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Close at the end of the block."""
        self.close()
