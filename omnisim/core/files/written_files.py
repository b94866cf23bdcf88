"""Finished files of a run."""

from __future__ import annotations

from pathlib import Path


def is_written(path: Path) -> bool:
    """True if a file exists and is not empty."""
    try:
        return path.stat().st_size > 0
    except FileNotFoundError:
        return False
