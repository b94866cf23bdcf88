"""Channels as NumPy's .npy files."""

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

    AUTO = "auto"  # layers of an EXR; beside other images PNG, EXR and FLO
    NPY = "npy"
    BOTH = "both"

    @classmethod
    def parse(cls, text: str | None) -> ChannelFormat:
        """Format of a name; None: auto.

        Raises:
            OutputError: an unknown name.
        """
        try:
            return cls.AUTO if text is None else cls(text.strip().lower())
        except ValueError:
            names = ", ".join(cls)
            raise OutputError(f"channel format: expected one of {names}, got {text!r}") from None


def write_npy(path: Path, values: NDArray[Any]) -> None:
    """Write an array as it is, dtype and all.

    Raises:
        OutputError: the file cannot be written.
    """
    with atomic_write(path) as partial, partial.open("wb") as file:
        np.save(file, values, allow_pickle=False)


def read_npy(path: Path) -> NDArray[Any]:
    """Read an array of numbers.

    Raises:
        OutputError: the file is missing, or damaged.
    """
    try:
        # mapped, so that a damaged header cannot ask for more memory than the file has
        with warnings.catch_warnings(action="ignore"):  # of headers of Python 2
            values = np.array(np.load(path, mmap_mode="r", allow_pickle=False))
    except OSError as reason:
        raise OutputError(f"{path}: cannot be read: {reason.strerror or 'damaged'}") from None
    except (ValueError, TypeError, EOFError, ArithmeticError, SyntaxError, TokenError):
        raise OutputError(f"{path}: expected an array of numbers, as NumPy writes it") from None
    if values.dtype.kind not in "fiub":
        raise OutputError(f"{path}: expected an array of numbers, got {values.dtype}")
    return values
