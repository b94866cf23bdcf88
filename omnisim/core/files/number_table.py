"""Tables of numbers: CSV with nine digits, written in blocks."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from omnisim.core.files.atomic_file import atomic_write

BLOCK = 10_000  # rows per block, which bounds memory


def write_table(path: Path, columns: str, blocks: Iterable[NDArray[np.float64]]) -> None:
    """Write blocks (n, columns) one below the other, atomically.

    Raises:
        OutputError: the file cannot be written.
    """
    with atomic_write(path) as partial, partial.open("w", encoding="utf-8", newline="\n") as file:
        file.write(f"{columns}\n")
        for block in blocks:
            file.writelines(
                ",".join(f"{value:.9f}" for value in row) + "\n" for row in block.tolist()
            )
