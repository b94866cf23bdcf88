"""Errors that a user can act on, with one clear line each.

The command line prints the message of an `OmnisimError` and exits with status 1. Any other
exception is a defect of omnisim and keeps its traceback.
"""

from __future__ import annotations

from collections.abc import Iterable

MAX_LINE = 600  # maximum characters of a message line, since damaged files can hold any length


class NoticeWarning(UserWarning):
    """Notice about a file: an unsupported feature, or a default that was chosen."""


class OmnisimError(Exception):
    """Base of all errors with a message for the user.

    Its lines are printable and of limited length, whatever the file contains.

    Attributes:
        exit_status: exit status of the command line.
    """

    exit_status = 1

    def __init__(self, message: str = ""):
        super().__init__("\n".join(map(printable, message.split("\n"))))


class OpticsError(OmnisimError):
    """Parameters are impossible for a mirror, camera or scanner."""


class SceneError(OmnisimError):
    """A scene cannot be read, or is empty."""


class SensorFileError(OmnisimError):
    """A sensor or optics file has an unknown key or an impossible value."""


class RobotFileError(OmnisimError):
    """A robot file or a USARSim configuration is invalid."""


class TrajectoryError(OmnisimError):
    """Poses, times or odometry are impossible, or a file of them is invalid."""


class GraphicsError(OmnisimError):
    """OpenGL is missing or too old, a size exceeds its limits, or a shader does not compile.

    Attributes:
        cause, remedy: the two halves of the message; a message may lack the second.
    """

    def __init__(self, cause: str = "", remedy: str = ""):
        super().__init__(f"{cause}: {remedy}" if remedy else cause)
        self.cause, self.remedy = cause, remedy


class RunError(OmnisimError):
    """A folder is not a run or holds another run, or a drive is impossible."""


class OutputError(OmnisimError):
    """An image, mesh, scan or plot cannot be written, or read back."""


class PlanError(OmnisimError):
    """A plan of a data set or a sweep is invalid, or cannot be carried out."""


class EstimatorError(OmnisimError):
    """An estimator cannot be applied to a run, or has failed."""


class LocalizationError(OmnisimError):
    """Colors, landmarks, measurements or times cannot localize a robot."""


class CalibrationError(OmnisimError):
    """A calibration file is invalid, or its parameters do not suit the camera model."""


class ServeError(OmnisimError):
    """A served robot cannot do what a client asks."""


class MeasurementError(OmnisimError):
    """Images do not suffice to measure a camera."""


def printable(line: str, max_length: int = MAX_LINE) -> str:
    """Escape unprintable characters of a line, and shorten a long line in the middle."""
    if not line.isprintable():
        escaped = (x if x.isprintable() else x.encode("unicode_escape").decode() for x in line)
        line = "".join(escaped)
    if len(line) > max_length:
        end = (max_length - 3) // 2
        line = f"{line[:end]} … {line[-end:]}"
    return line


def did_you_mean(word: str, known: Iterable[str], otherwise: str = "expected one of") -> str:
    """Suggest the nearest known name, or list all of them, after `otherwise`."""
    import difflib  # only needed after an error
    import re

    names = list(known)
    # the same name with another number, as cam7 for cam1, is not a misspelling
    spelled = [known for known in names if re.sub(r"\d", "", known) != re.sub(r"\d", "", word)]
    near = difflib.get_close_matches(word, spelled, n=1, cutoff=0.65)
    parts = [known for known in names if word and known.startswith(word)]
    near = parts or [known for known in names if known.endswith(f"/{word}")] or near
    if near:
        return f"did you mean {' or '.join(map(repr, near))}?"
    return f"{otherwise} {', '.join(names) or 'none'}"
