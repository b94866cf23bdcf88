"""Ground truth in the folder of a run: files of the whole run."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from omnisim.core.errors import RunError
from omnisim.ground_truth import Labels
from omnisim.ground_truth.channels import CLASSES
from omnisim.ground_truth.coco import merged, write_json
from omnisim.runs.run_folder import BOXES, LABELS, RunFolder
from omnisim.sensors.omnicamera.mounted_omnicamera import BOXES_SUFFIX


def write_labels(run: RunFolder, labels: Labels) -> None:
    """Write the table of class and instance IDs, if the run records them.

    Raises:
        OutputError: the file cannot be written.
    """
    manifest = run.manifest
    is_needed = bool({*CLASSES, "instance"} & set(manifest.channels)) or any(
        manifest.sensor_class(name).has_instances for name in manifest.sensors
    )
    if is_needed and not run.has(LABELS):
        write_json(run.path / LABELS, labels.to_json())


def write_boxes(run: RunFolder, labels: Labels) -> None:
    """Merge the boxes of all steps of each camera into one file, if the run records them.

    Raises:
        RunError: boxes of a step are damaged.
        OutputError: a file cannot be written.
    """
    if "instance" not in run.manifest.channels:
        return
    for camera in run.manifest.cameras:
        if not run.has(f"{camera}/{BOXES}"):
            indices = range(run.measurements(camera))
            parts = [_read(run.file(camera, index, BOXES_SUFFIX)) for index in indices]
            write_json(run.path / camera / BOXES, merged(parts, labels))


def _read(path: Path) -> dict[str, Any]:
    try:
        content: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
        return content
    except (OSError, ValueError, RecursionError):
        raise RunError(f"{path}: cannot be read: remove it, and record the run again") from None
