"""What a file format is to omnisim: how to know it, read it and write it, and what it can say."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from enum import Enum
from typing import Any

import numpy as np

from omnisim.calibration.calibration import Pose
from omnisim.cameras import CentralCamera
from omnisim.errors import CalibrationError, OpticsError

# Given to a fit of the unified model it leaves skew and k3 out, which most formats have not.
NO_SKEW = {"skew_px": 0.0}


class Remarks(Enum):
    """Where a format has room for what only omnisim says; see `remarks`."""

    LINES = "# omnisim {…}"
    XML = "<!-- omnisim {…} -->"
    KEY = '"omnisim": […]'


@dataclass(frozen=True, eq=False)
class Said:
    """One camera in a file's own words.

    Attributes:
        name: what the file calls it.
        lens: looks along +z of the file's frame.
        poses: where it is.
        notes: what a reader should know.
    """

    name: str
    lens: CentralCamera
    poses: tuple[Pose, ...] = ()
    notes: tuple[str, ...] = ()


def _never(lens: Any) -> str | None:
    return None


def nameless(index: int, name: str) -> str:
    """What a camera is called in a format that has no names."""
    return "camera"


def _clear(text: str, source: str) -> str | None:
    return None


def _keep(index: int, name: str) -> str:
    return name


@dataclass(frozen=True)
class Format:
    """A file format.

    Attributes:
        name: what the command line calls it.
        title: whose it is.
        suffix: of its files.
        looks_like: whether a text is of it, broken or not.
        read: its cameras; the second argument names the file. Raises CalibrationError.
        write: the text of cameras whose lenses are of `models` and not refused.
        models: what it says exactly, the best known first.
        fits: models to fit where none says it exactly, with attributes that are given.
        refuse: why it cannot say a lens of `models`, or None.
        remarks: where its files have room for what only omnisim says.
        widest_rad: angle from the axis past which it says nothing, if there is one.
        unclear: why a text of this format cannot be read unless the user names the format, or None.
        centred: whether the axis is in the picture's middle always.
        doubtful_past_rad, doubt: angle from the axis past which others read its parameters
            differently, and what to know then.
        several: whether a file holds more than one camera.
        rename: what it calls a camera, by its place in the file and the name it has.
        is_own: omnisim's own, which says mirrors as mirrors.
    """

    name: str
    title: str
    suffix: str
    looks_like: Callable[[str], bool]
    read: Callable[[str, str], list[Said]]
    write: Callable[[Sequence[Said]], str]
    models: tuple[type[Any], ...]
    fits: tuple[tuple[type[Any], Mapping[str, Any]], ...] = ()
    refuse: Callable[[Any], str | None] = field(default=_never)
    remarks: Remarks = Remarks.LINES
    widest_rad: float | None = None
    unclear: Callable[[str, str], str | None] = field(default=_clear)
    centred: bool = False
    doubtful_past_rad: float = math.inf
    doubt: str = ""
    several: bool = False
    rename: Callable[[int, str], str] = field(default=_keep)
    is_own: bool = False


@contextmanager
def making(source: str) -> Iterator[None]:
    """Name the place in a file whose numbers make no camera.

    Raises:
        CalibrationError: what the block found wrong, with `source` before it.
    """
    try:
        # squares of what is much too large are not worth a warning: what follows is refused
        with np.errstate(all="ignore"):
            yield
    except OpticsError as reason:
        words = str(reason).removeprefix("camera: ")
        raise CalibrationError(f"{source}: {words}") from None
    except (ArithmeticError, ValueError, np.linalg.LinAlgError) as reason:
        raise CalibrationError(f"{source}: numbers that no camera has: {reason}") from None
