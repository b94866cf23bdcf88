"""A camera's parameters as they come from outside: checks, with errors that name the key."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from typing import Any, Protocol

from omnisim.errors import OpticsError

# Far past any camera; squares of what follows from them still fit into a float.
FOCAL_LENGTHS_PX = (1e-30, 1e30)
LARGEST_PX = 1e15


class _Picture(Protocol):
    width_px: int
    height_px: int
    focal_length_px: float
    principal_point_px: tuple[float, float]


def check_picture(camera: _Picture) -> None:
    """Refuse a size, focal length or principal point that no picture has.

    Raises:
        OpticsError: naming what is wrong, and what was wanted.
    """
    if camera.width_px < 1 or camera.height_px < 1:
        raise OpticsError(f"camera: size {camera.width_px} × {camera.height_px}: want at least 1")
    shortest, longest = FOCAL_LENGTHS_PX
    if not shortest <= camera.focal_length_px <= longest:  # nor NaN
        raise OpticsError(
            f"camera: focal_length_px = {camera.focal_length_px:g}: want > 0, "
            f"from {shortest:g} to {longest:g}"
        )
    if not all(abs(value) <= LARGEST_PX for value in camera.principal_point_px):
        raise OpticsError(
            f"camera: principal_point_px = {camera.principal_point_px}: want finite numbers, "
            f"within ±{LARGEST_PX:g}"
        )


def number(parameters: Mapping[str, Any], key: str) -> float:
    """The finite number under `key`.

    Raises:
        OpticsError: it is missing, or is none.
    """
    value = _value(parameters, key)
    # a whole number may be too large for a float; NaN is not within anything
    if type(value) not in (int, float) or not abs(value) <= sys.float_info.max:
        raise OpticsError(f"camera: {key} = {value!r}: want a number")
    return float(value)


def whole_number(parameters: Mapping[str, Any], key: str) -> int:
    """The whole number under `key`.

    Raises:
        OpticsError: it is missing, or is none.
    """
    value = _value(parameters, key)
    if type(value) is not int:
        raise OpticsError(f"camera: {key} = {value!r}: want a whole number")
    return value


def point(parameters: Mapping[str, Any], key: str) -> tuple[float, float]:
    """The two finite numbers under `key`.

    Raises:
        OpticsError: they are missing, or not two numbers.
    """
    value = _value(parameters, key)
    if not isinstance(value, list | tuple) or len(value) != 2:
        raise OpticsError(f"camera: {key} = {value!r}: want [u, v]")
    return number({key: value[0]}, key), number({key: value[1]}, key)


def _value(parameters: Mapping[str, Any], key: str) -> Any:
    if key not in parameters:
        raise OpticsError(f"camera: {key}: missing")
    return parameters[key]
