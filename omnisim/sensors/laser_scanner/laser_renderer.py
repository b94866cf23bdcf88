"""A laser scanner in a scene: states of the world in, scans out."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from omnisim.core.poses import check_pose
from omnisim.core.version import __version__
from omnisim.core.world import ObjectPart, WorldState
from omnisim.rendering.backend import RangeFinder
from omnisim.rendering.stage import BackendName, SensorRenderer, Stage
from omnisim.scene import Scene
from omnisim.sensors.laser_scanner.laser_scanner import LaserScanner
from omnisim.sensors.laser_scanner.scan import Scan


class LaserRenderer(SensorRenderer[RangeFinder]):
    """Takes a scanner's scans of a scene; loads and compiles everything once.

    Use it as a context manager, or `close` it: it holds memory of the GPU.

    Args:
        scene: to scan, or its path or built-in name; or a stage of it that other sensors share.
        scanner: by default an LMS200.
        body: of the vehicle, in its base frame; a stage has its own.
        base_from_scanner: (4, 4) its mount on the vehicle; by default at the base.
        hidden: names of the body's instances that beams go through: the scanner's own housing.
        device: EGL's number of the GPU, as `omnisim info` lists them; None takes the first. A
            stage has chosen already.
        vehicle: name of the vehicle that carries the scanner, of a stage with several.
        backend: "cube" casts beams by OpenGL, "rays" by Embree. A stage has chosen already.

    Raises:
        GraphicsError: no OpenGL, too old an OpenGL, or a scene past its limits.
        SceneError: a hidden name that the body does not have.
    """

    def __init__(
        self,
        scene: Scene | Stage | str | Path,
        scanner: LaserScanner | None = None,
        *,
        base_from_scanner: ArrayLike | None = None,
        body: Scene | None = None,
        hidden: Collection[str] = (),
        device: int | None = None,
        vehicle: str | None = None,
        backend: BackendName | None = None,
    ):
        self.scanner = LaserScanner() if scanner is None else scanner
        self._base_from_scanner = check_pose(
            np.eye(4) if base_from_scanner is None else base_from_scanner
        )
        self._angles_rad = np.radians(self.scanner.angles_deg)

        def make_passes(stage: Stage, parts: frozenset[ObjectPart]) -> RangeFinder:
            return stage.backend.range_finder(self._angles_rad, self.scanner.reach_m, parts)

        super().__init__(scene, body, hidden, device, make_passes, vehicle, backend)

    def _sensor_summary(self) -> str:
        return f"{len(self._angles_rad)} beams"

    def scan(self, state: WorldState | ArrayLike, scan_number: int = 0) -> Scan:
        """Take one scan.

        Args:
            state: of the world; or, where nothing else moves, the (4, 4) pose of the vehicle.
            scan_number: of the drive; the noise depends on it and on the scanner's seed alone.

        Raises:
            OmnisimError: a matrix that is not a pose, an object without one, a number that is none,
                or the renderer or its stage is closed.
        """
        now = self._state(state)
        world_from_base = now.world_from_object[self.vehicle]
        world_from_scanner = world_from_base @ self._base_from_scanner
        with self._current() as ranges:
            true_ranges_m = ranges.cast(world_from_scanner, self._stage.poses_in(now))
        ranges_m = self.scanner.measure(true_ranges_m, scan_number)
        metadata = {
            "omnisim": __version__,
            "scene": self.scene.name,
            **self._body_metadata(),
            "scan_number": int(scan_number),
        }
        if self.body is not None:
            metadata["world_from_base"] = world_from_base.tolist()
        return Scan(self._angles_rad, ranges_m, self.scanner, world_from_scanner, metadata)
