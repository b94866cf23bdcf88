"""A camera's parameters as they come from outside: checks, with errors that name the key."""

from __future__ import annotations

import math
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


class _FocalPicture(_Picture, Protocol):
    focal_length_px: float
    principal_point_px: tuple[float, float]


def check_picture(camera: _FocalPicture) -> None:
    """Refuse a size, focal length or principal point that no picture has.

    Raises:
        OpticsError: naming what is wrong, and what was wanted.
    """
    check_size(camera)
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


def check_size(camera: _Picture) -> None:
    """Refuse a picture without pixels.

    Raises:
        OpticsError: naming the size.
    """
    if camera.width_px < 1 or camera.height_px < 1:
        raise OpticsError(f"camera: size {camera.width_px} × {camera.height_px}: want at least 1")


def check_finite(camera: object, *names: str) -> None:
    """Refuse infinities and NaN in numbers or tuples of numbers.

    Raises:
        OpticsError: naming the attribute.
    """
    for name in names:
        value = getattr(camera, name)
        if not all(math.isfinite(one) for one in (value if isinstance(value, tuple) else (value,))):
            raise OpticsError(f"camera: {name} = {value}: want finite numbers")


def check_limits(
    camera: object, name: str, lowest: float, highest: float, wanted: str | None = None
) -> None:
    """Refuse a number outside [lowest, highest].

    Raises:
        OpticsError: naming the attribute, its value and what was wanted.
    """
    value = getattr(camera, name)
    if not lowest <= value <= highest:  # false for NaN, too
        wanted = wanted or f"{lowest:g} to {highest:g}"
        raise OpticsError(f"camera: {name} = {value:g}: want {wanted}")


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


def numbers(parameters: Mapping[str, Any], key: str) -> tuple[float, ...]:
    """The finite numbers of the list under `key`.

    Raises:
        OpticsError: they are missing, or not a list of numbers.
    """
    value = _value(parameters, key)
    if not isinstance(value, list | tuple):
        raise OpticsError(f"camera: {key} = {value!r}: want a list of numbers")
    return tuple(number({key: one}, key) for one in value)


def word(parameters: Mapping[str, Any], key: str) -> str:
    """The word under `key`.

    Raises:
        OpticsError: it is missing, or is none.
    """
    value = _value(parameters, key)
    if not isinstance(value, str):
        raise OpticsError(f"camera: {key} = {value!r}: want a word")
    return value


def _value(parameters: Mapping[str, Any], key: str) -> Any:
    if key not in parameters:
        raise OpticsError(f"camera: {key}: missing")
    return parameters[key]
