"""Lookup of robot files by path, folder or built-in name."""

from __future__ import annotations

from pathlib import Path

from omnisim.core.errors import RobotFileError, did_you_mean
from omnisim.core.package_files import SCENES, built_in

ROBOT_FILE = "robot.toml"


def builtin_robots() -> list[str]:
    """Names of the built-in robots, sorted."""
    return built_in(ROBOT_FILE)


def find_robot(source: str | Path) -> Path:
    """Find a robot file by its path, a folder with a `robot.toml`, or a built-in name.

    Raises:
        RobotFileError: no such robot file, or it cannot be read.
    """
    try:
        return _find(Path(source), str(source))
    except OSError as reason:  # such as a folder without permission or an overlong name
        raise RobotFileError(f"{source}: cannot be read: {reason.strerror}") from None


def _find(path: Path, name: str) -> Path:
    if path.is_dir() and (path / ROBOT_FILE).is_file():
        return path / ROBOT_FILE
    if path.is_file():
        return path
    names = builtin_robots()
    if name in names:
        return SCENES / name / ROBOT_FILE
    if path.is_dir():
        raise RobotFileError(f"{path}: is a folder without a {ROBOT_FILE}: expected a robot file")
    if path.exists():
        raise RobotFileError(f"{path}: is not a regular file")
    hint = did_you_mean(name, names, "built-in:")
    raise RobotFileError(f"{name}: no such robot file, and no built-in robot; {hint}")
