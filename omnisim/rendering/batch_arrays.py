"""Arrays of a batch, new or the caller's: images and channels of ground truth."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from omnisim.core.errors import OutputError
from omnisim.ground_truth import CHANNELS, check_channels

IMAGES = {"rgb": 3, "rgba": 4}  # components per pixel


def check_contents(names: Collection[str]) -> tuple[str, ...]:
    """Names in order: images first, then channels in the order of `CHANNELS`.

    Raises:
        OutputError: an unknown name, a string instead of names, or both images.
    """
    if isinstance(names, str):
        return check_channels(names)  # raises
    images = [name for name in IMAGES if name in names]
    if len(images) == len(IMAGES):
        raise OutputError("channels: expected one of rgb and rgba, got both")
    return (*images, *check_channels(name for name in names if name not in IMAGES))


def batch_arrays(
    names: Collection[str],
    size: tuple[int, int, int],
    out: NDArray[Any] | Mapping[str, NDArray[Any]] | None,
) -> dict[str, NDArray[Any]]:
    """Arrays by name, contiguous and writeable.

    Args:
        names: names from `check_contents`.
        size: number, height and width of the images.
        out: arrays of the caller by name, or the array of the only name; None: new arrays.

    Raises:
        OutputError: an array of another shape or type, a read-only one, or other names.
    """
    if out is None:
        return {name: np.empty(*_layout(name, size)) for name in names}
    if not isinstance(out, Mapping):
        if len(names) != 1:
            raise OutputError(f"out: expected arrays by name: {', '.join(names)}, got one array")
        return {name: _check("out", out, *_layout(name, size)) for name in names}
    if out.keys() != set(names):
        actual = ", ".join(map(str, out)) or "none"
        raise OutputError(f"out: expected arrays by name: {', '.join(names)}, got {actual}")
    return {name: _check(f"out[{name!r}]", out[name], *_layout(name, size)) for name in names}


def _layout(name: str, size: tuple[int, int, int]) -> tuple[tuple[int, ...], np.dtype[Any]]:
    """Shape and type of an array."""
    if name in IMAGES:
        return (*size, IMAGES[name]), np.dtype(np.uint8)
    channel = CHANNELS[name]
    parts = len(channel.layers)
    return (*size, parts) if parts > 1 else size, np.dtype(channel.dtype)


def _check(
    what: str, array: NDArray[Any], shape: tuple[int, ...], dtype: np.dtype[Any]
) -> NDArray[Any]:
    """Return the caller's array if it can be filled in place."""
    if isinstance(array, np.ndarray):
        faults = {
            f"type {array.dtype}": array.dtype == dtype,
            f"shape {array.shape}": array.shape == shape,
            "one that is not contiguous": array.flags.c_contiguous,
            "a read-only one": array.flags.writeable,
        }
        actual = next((fault for fault, is_right in faults.items() if not is_right), None)
    else:
        actual = type(array).__name__
    if actual is None:
        return array
    raise OutputError(
        f"{what}: expected a writeable, C-contiguous NumPy array of {dtype} and shape {shape}, "
        f"got {actual}"
    )
