"""One scan of a laser scanner, and its file."""

from __future__ import annotations

import dataclasses
import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from omnisim.core.files.atomic_file import write_text
from omnisim.core.short_repr import short_repr
from omnisim.sensors.laser_scanner.laser_scanner import LaserScanner


@dataclass(frozen=True, eq=False)
class Scan:
    """Ranges of a scanner, beam by beam from right to left.

    Attributes:
        angles_rad: (beams,) counter-clockwise from straight ahead.
        ranges_m: (beams,) +inf: out of range; −inf: too near (REP 117).
        scanner: that took it.
        world_from_scanner: (4, 4) its pose.
        metadata: omnisim's version, the scene, the number of the scan.
    """

    angles_rad: NDArray[np.float64]
    ranges_m: NDArray[np.float64]
    scanner: LaserScanner
    world_from_scanner: NDArray[np.float64]
    metadata: dict[str, Any] = field(default_factory=dict)

    def __repr__(self) -> str:
        beams, scene = len(self.angles_rad), self.metadata.get("scene")
        where = "" if scene is None else f"scene {scene!r}"
        return short_repr(self, f"{beams} beams", f"{np.count_nonzero(self.hit)} hits", where)

    @property
    def hit(self) -> NDArray[np.bool_]:
        """Mask (beams,) of the beams that have a range."""
        return np.isfinite(self.ranges_m)

    @property
    def points_m(self) -> NDArray[np.float64]:
        """Points (k, 3) in the scanner's frame, of the beams that have a range."""
        angles, ranges = self.angles_rad[self.hit], self.ranges_m[self.hit]
        return np.stack(
            (ranges * np.cos(angles), ranges * np.sin(angles), np.zeros_like(ranges)), axis=-1
        )

    def save_csv(self, path: str | Path) -> None:
        """Write columns beam, angle_deg and range_m; the file is written atomically.

        Lines that start with `#` come first, `# key: value` with the value in JSON: the metadata,
        the scanner's parameters under their own names, and `world_from_scanner`, the pose by rows.
        Ranges are `inf` out of range and `-inf` too near, as NumPy reads them.

        Raises:
            OutputError: the file cannot be written.
        """
        header = {
            **self.metadata,
            **dataclasses.asdict(self.scanner),
            "world_from_scanner": self.world_from_scanner.tolist(),
        }
        lines = [
            f"# {key}: {json.dumps(value, ensure_ascii=False)}" for key, value in header.items()
        ]
        lines.append("beam,angle_deg,range_m")
        angles_deg = np.degrees(self.angles_rad)
        lines += [
            f"{beam},{angle:.6f},{range_m:.6f}"
            for beam, (angle, range_m) in enumerate(zip(angles_deg, self.ranges_m, strict=True))
        ]
        write_text(Path(path), "\n".join(lines) + "\n")
