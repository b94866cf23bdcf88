"""USD stages as scene contents."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from omnisim.core.files.sources import Sources, note_sources, recorded_sources
from omnisim.scene.formats.imported_scene import FileAxes, ImportedScene
from omnisim.scene.formats.usd.process import call_isolated


def read_usd(path: Path, axes: FileAxes) -> tuple[ImportedScene, NDArray[np.float64]]:
    """Read a stage in a separate process.

    Args:
        path: path of the stage.
        axes: overrides of the stage's up axis and unit.

    Returns:
        Scene contents, and the transform (4, 4) from the stage to the world frame.

    Raises:
        SceneError: the stage is damaged.
    """
    read, matrix, sources = call_isolated(_read, path, axes)
    note_sources(sources)
    return read, matrix


def _read(path: Path, axes: FileAxes) -> tuple[ImportedScene, NDArray[np.float64], Sources]:
    from omnisim.scene.formats.usd.stage_reader import read_stage  # imports usd-core, slow

    with recorded_sources() as sources:
        read, matrix = read_stage(path, axes)
    return read, matrix, sources
