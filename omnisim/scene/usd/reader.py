"""Stages as contents of a scene."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from omnisim.scene.file_axes import FileAxes
from omnisim.scene.imported import ImportedScene
from omnisim.scene.usd.process import call_isolated


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
    return call_isolated(_read, path, axes)


def _read(path: Path, axes: FileAxes) -> tuple[ImportedScene, NDArray[np.float64]]:
    from omnisim.scene.usd.stage_reader import read_stage  # with usd-core, slow to import

    return read_stage(path, axes)
