"""Arrays of numbers in files: NPZ archives, and CSV with nine digits, written in blocks."""

from __future__ import annotations

import warnings
from collections.abc import Collection, Iterable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from omnisim.core.arrays import Floats
from omnisim.core.errors import OmnisimError
from omnisim.core.files.atomic_file import atomic_write


def read_arrays(
    path: Path,
    error: type[OmnisimError],
    kind: str,
    expected: str,
    names: Collection[str] | None = None,
) -> dict[str, NDArray[Any]]:
    """Read all arrays of an archive, or the existing ones among `names`; nothing is unpickled.

    Messages name the kind of archive, with its article, and the expected content.

    Raises:
        error: the file cannot be read, or is not an archive.
    """
    try:
        quiet = warnings.catch_warnings(action="ignore")
        with quiet, np.load(path, allow_pickle=False) as stored:
            selected_names = (
                stored.files if names is None else [file for file in stored.files if file in names]
            )
            arrays = {name: stored[name] for name in selected_names}
    except OSError as reason:
        message = reason.strerror or f"not {kind}"
        raise error(f"{path}: cannot be read: {message}: {expected}") from None
    except Exception:  # NumPy and zipfile raise many exceptions for a damaged file
        raise error(f"{path}: is not {kind}: {expected}") from None
    if not all(isinstance(array, np.ndarray) for array in arrays.values()):  # bytes of another file
        raise error(f"{path}: is not {kind}: {expected}")
    return arrays


# Tables of numbers: CSV with nine digits, written in blocks.


BLOCK = 10_000  # rows per block, which bounds memory


def write_table(path: Path, columns: str, blocks: Iterable[Floats]) -> None:
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
