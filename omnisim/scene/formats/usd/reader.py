"""Stages as contents of a scene."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from omnisim.core.files.sources import Sources, note_sources, recorded_sources
from omnisim.scene.files.file_axes import FileAxes
from omnisim.scene.files.imported import ImportedScene
from omnisim.scene.formats.usd.process import call_isolated


def read_usd(path: Path, axes: FileAxes) -> tuple[ImportedScene, NDArray[np.float64]]:
    """Read a stage, in a process of its own.

    Args:
        path: of the stage.
        axes: overrule those of the stage.

    Returns:
        The contents, and the transform (4, 4) from the stage to the world frame.

    Raises:
        SceneError: it is damaged.
    """
    read, matrix, sources = call_isolated(_read, path, axes)
    note_sources(sources)
    return read, matrix


def _read(path: Path, axes: FileAxes) -> tuple[ImportedScene, NDArray[np.float64], Sources]:
    from omnisim.scene.formats.usd.stage_reader import read_stage  # with usd-core, slow to import

    with recorded_sources() as sources:
        read, matrix = read_stage(path, axes)
    return read, matrix, sources
