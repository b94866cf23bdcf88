"""Files of free floors, computed once for a data set and read by all of its processes."""

from __future__ import annotations

import zipfile
from pathlib import Path

import numpy as np

from omnisim.core.files.atomic_file import atomic_write
from omnisim.datasets.free_space import FreeSpace

PATTERN = ".free-*.npz"  # hidden, as they are not part of the data set


def free_space_path(folder: Path, fingerprint: str, scene: int) -> Path:
    """Path of the free floor of a scene, by the plan's fingerprint and the scene's index."""
    return folder / f".free-{fingerprint}-{scene}.npz"


def read_free_space(path: Path) -> FreeSpace | None:
    """Read a free floor; None: the file is missing or damaged."""
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as arrays:
            low_m, cell_m = arrays["low_m"], float(arrays["cell_m"])
            floor_m, clearance_m, is_free = (
                arrays[key] for key in ("floor_m", "clearance_m", "is_free")
            )
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile):
        return None
    same = floor_m.shape == clearance_m.shape == is_free.shape
    return FreeSpace(low_m, cell_m, floor_m, clearance_m, is_free) if same else None


def write_free_space(path: Path, free: FreeSpace) -> None:
    """Write a free floor, atomically.

    Raises:
        OutputError: the file cannot be written.
    """
    with atomic_write(path) as partial, partial.open("wb") as file:
        np.savez(
            file,
            low_m=free.low_m,
            cell_m=np.float64(free.cell_m),
            floor_m=free.floor_m,
            clearance_m=free.clearance_m,
            is_free=free.is_free,
        )
