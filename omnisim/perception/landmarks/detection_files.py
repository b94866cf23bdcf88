"""Detections as CSV: one per line, `step` first; angles in degrees."""

from __future__ import annotations

import math
from collections.abc import Iterable
from pathlib import Path

from omnisim.core.files.atomic_file import write_text
from omnisim.perception.landmarks.landmark_detector import Detection

COLUMNS = (
    "step,landmark,bearing_deg,range_m,range_eq2_m,bearing_sigma_deg,range_sigma_m,"
    "left_px,right_px,top_px,bottom_px,area_px"
)
SUFFIX = ".csv"


def write_detections(path: Path, detections: Iterable[tuple[int, Detection]]) -> None:
    """Write detections with their steps; atomically.

    Raises:
        OutputError: the file cannot be written.
    """
    lines = [COLUMNS]
    for step, detection in detections:
        numbers = (
            math.degrees(detection.bearing_rad),
            detection.range_m,
            detection.range_eq2_m,
            math.degrees(detection.bearing_sigma_rad),
            detection.range_sigma_m,
        )
        box = (detection.left, detection.right, detection.top, detection.bottom, detection.area_px)
        cells = (*(f"{number:.6f}" for number in numbers), *map(str, box))
        lines.append(",".join((str(step), detection.landmark, *cells)))
    write_text(path, "\n".join(lines) + "\n")
