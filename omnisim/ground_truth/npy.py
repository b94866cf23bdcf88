"""Channels as NumPy .npy files."""

from __future__ import annotations

import warnings
from enum import StrEnum
from pathlib import Path
from tokenize import TokenError
from typing import Any

import numpy as np
from numpy.typing import NDArray

from omnisim.core.errors import OutputError
from omnisim.core.files.atomic_file import atomic_write


class ChannelFormat(StrEnum):
    """File formats of an image's channels."""

    AUTO = "auto"  # EXR: layers; other image formats: PNG, EXR and FLO files
    NPY = "npy"
    BOTH = "both"

    @classmethod
    def parse(cls, text: str | None) -> ChannelFormat:
        """Format by name; None: `AUTO`.

        Raises:
            OutputError: an unknown name.
        """
        try:
            return cls.AUTO if text is None else cls(text.strip().lower())
        except ValueError:
            names = ", ".join(cls)
            raise OutputError(f"channel format: expected one of {names}, got {text!r}") from None


def write_npy(path: Path, values: NDArray[Any]) -> None:
    """Write an array unchanged, including its dtype.

    Raises:
        OutputError: the file cannot be written.
    """
    with atomic_write(path) as partial, partial.open("wb") as file:
        np.save(file, values, allow_pickle=False)


def read_npy(path: Path) -> NDArray[Any]:
    """Read a numeric array.

    Raises:
        OutputError: the file is missing or damaged, or holds no numbers.
    """
    try:
        # memory-mapped, so that a damaged header cannot request more memory than the file has
        with warnings.catch_warnings(action="ignore"):  # about headers from Python 2
            values = np.array(np.load(path, mmap_mode="r", allow_pickle=False))
    except OSError as reason:
        raise OutputError(f"{path}: cannot be read: {reason.strerror or 'damaged'}") from None
    except (ValueError, TypeError, EOFError, ArithmeticError, SyntaxError, TokenError):
        raise OutputError(f"{path}: expected an array of numbers, as NumPy writes it") from None
    if values.dtype.kind not in "fiub":
        raise OutputError(f"{path}: expected an array of numbers, got {values.dtype}")
    return values
