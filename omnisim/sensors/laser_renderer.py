"""A laser scanner in a scene: poses in, scans out."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from omnisim.errors import OmnisimError
from omnisim.gpu.scene.range_pass import RangePass
from omnisim.poses import check_pose
from omnisim.scene import Scene
from omnisim.sensors.laser_scanner import LaserScanner
from omnisim.sensors.scan import Scan
from omnisim.sensors.stage import SensorRenderer, Stage
from omnisim.version import __version__


class LaserRenderer(SensorRenderer[RangePass]):
    """Takes a scanner's scans of a scene; loads and compiles everything once.

    Use it as a context manager, or `close` it: it holds memory of the GPU.

    Args:
        scene: to scan, or its path or built-in name; or a stage of it that other sensors share.
        scanner: by default an LMS200.
        body: of the vehicle, in its base frame; a stage has its own.
        hidden: names of the body's instances that beams go through: the scanner's own housing.
        device: EGL's number of the GPU, as `omnisim info` lists them; None takes the first. A
            stage has chosen already.

    Raises:
        GraphicsError: no OpenGL, too old an OpenGL, or a scene past its limits.
        SceneError: a hidden name that the body does not have.
    """

    def __init__(
        self,
        scene: Scene | Stage | str | Path,
        scanner: LaserScanner | None = None,
        *,
        body: Scene | None = None,
        hidden: Collection[str] = (),
        device: int | None = None,
    ):
        self.scanner = LaserScanner() if scanner is None else scanner
        self._angles_rad = np.radians(self.scanner.angles_deg)

        def make_passes(stage: Stage) -> RangePass:
            return RangePass(stage.buffers, self._angles_rad, self.scanner.reach_m, hidden)

        super().__init__(scene, body, hidden, device, make_passes)

    def _sensor_summary(self) -> str:
        return f"{len(self._angles_rad)} beams"

    def scan(
        self,
        world_from_scanner: ArrayLike,
        scan_number: int = 0,
        *,
        world_from_base: ArrayLike | None = None,
        object_poses: Mapping[str, ArrayLike] | None = None,
    ) -> Scan:
        """Take one scan.

        Args:
            world_from_scanner: (4, 4) pose of the scanner, see `omnisim.poses.pose`.
            scan_number: of the drive; the noise depends on it and on the scanner's seed alone.
            world_from_base: (4, 4) pose of the body, if there is one: where the vehicle is. A
                scanner that is mounted on it at `base_from_scanner` is at
                `world_from_base @ base_from_scanner`.
            object_poses: (4, 4) poses of the dynamic objects, by name.

        Raises:
            OmnisimError: a matrix that is not a pose, a body without one, a number that is none,
                or the renderer or its stage is closed.
        """
        pose = check_pose(world_from_scanner)
        base = None if world_from_base is None else check_pose(world_from_base)
        if self.body is not None and base is None:
            raise OmnisimError("scan: expected world_from_base, the pose of the body, got none")
        with self._current() as ranges:
            true_ranges_m = ranges.cast(pose, self._stage.object_poses_at(base, object_poses))
        ranges_m = self.scanner.measure(true_ranges_m, scan_number)
        metadata = {
            "omnisim": __version__,
            "scene": self.scene.name,
            **self._body_metadata(),
            "scan_number": int(scan_number),
        }
        if self.body is not None and base is not None:
            metadata["world_from_base"] = base.tolist()
        return Scan(self._angles_rad, ranges_m, self.scanner, pose, metadata)
