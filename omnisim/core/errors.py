"""Errors that a user can act on: one clear line each.

The command line prints the message of an `OmnisimError` and exits with status 1. Anything else
that escapes is a defect of omnisim and keeps its traceback.
"""

from __future__ import annotations

from collections.abc import Iterable

MAX_LINE = 600  # letters of a message's line; what a damaged file holds has no end


class NoticeWarning(UserWarning):
    """Notice about a file: a feature that is left out, or a default that was chosen."""


class OmnisimError(Exception):
    """Base of all errors with a message meant for the user.

    Its lines are printable, whatever a file had in them, and of limited length.
    """

    def __init__(self, message: str = ""):
        super().__init__("\n".join(map(printable, message.split("\n"))))


class OpticsError(OmnisimError):
    """Parameters that no mirror, camera or scanner can have."""


class SceneError(OmnisimError):
    """A scene that cannot be read or has nothing to draw."""


class SensorFileError(OmnisimError):
    """A sensor or optics file with an unknown key or an impossible value."""


class RobotFileError(OmnisimError):
    """A robot file, or a USARSim configuration, with a fault."""


class TrajectoryError(OmnisimError):
    """Impossible poses, times or odometry, or a file of them with a fault."""


class GraphicsError(OmnisimError):
    """No OpenGL, too old an OpenGL, a size past its limits, or a shader that does not compile."""


class RunError(OmnisimError):
    """A folder that is no run, or another one's, or a drive that cannot be made."""


class OutputError(OmnisimError):
    """An image, mesh, scan or plot that cannot be written, or read back."""


class PlanError(OmnisimError):
    """A plan of a data set with a fault, or that cannot be carried out."""


class LocalizationError(OmnisimError):
    """Colors, landmarks, measurements or times that cannot localize a robot."""


class CalibrationError(OmnisimError):
    """A calibration file with a fault, or a model that has no such parameters."""


class MeasurementError(OmnisimError):
    """Images from which a camera cannot be measured."""


def printable(line: str, max_length: int = MAX_LINE) -> str:
    """Escape what cannot be printed in a line, and leave out the middle of a long one."""
    if not line.isprintable():
        escaped = (x if x.isprintable() else x.encode("unicode_escape").decode() for x in line)
        line = "".join(escaped)
    if len(line) > max_length:
        end = (max_length - 3) // 2
        line = f"{line[:end]} … {line[-end:]}"
    return line


def did_you_mean(word: str, known: Iterable[str], otherwise: str = "expected one of") -> str:
    """Suggests the nearest known word, or lists all of them.

    Args:
        word: what was given.
        known: what there is.
        otherwise: begins the list where nothing is near.
    """
    import difflib  # only a fault needs it
    import re

    words = list(known)
    # another number of the same name, as cam7 of cam1, is no misspelling
    spelled = [known for known in words if re.sub(r"\d", "", known) != re.sub(r"\d", "", word)]
    near = difflib.get_close_matches(word, spelled, n=1, cutoff=0.65)
    parts = [known for known in words if word and known.startswith(word)]
    near = parts or [known for known in words if known.endswith(f"/{word}")] or near
    if near:
        return f"did you mean {' or '.join(map(repr, near))}?"
    return f"{otherwise} {', '.join(words) or 'none'}"
