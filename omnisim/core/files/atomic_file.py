"""Atomic writing of files and folders, and validation of their paths."""

from __future__ import annotations

import os
import secrets
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path

from omnisim.core.errors import OutputError

# Files being written, with their new folders, for code that kills the process to remove.
partials: dict[Path, list[Path]] = {}


@contextmanager
def atomic_write(path: Path) -> Iterator[Path]:
    """Yield a temporary name beside `path` to write to; it becomes `path` at the end of the block.

    Missing folders are created. If the block fails, the temporary file and the new folders are
    removed, and `path` stays unchanged.

    Raises:
        OutputError: the file cannot be written.
    """
    target = path.resolve()  # a link stays a link
    with _partial_beside(target, path) as partial:
        yield partial
        os.replace(partial, target)


@contextmanager
def atomic_folder(path: Path) -> Iterator[Path]:
    """Yield a new folder of the same name to fill; it becomes `path` at the end of the block.

    It is created inside a hidden folder beside `path`, so that files named after their folder get
    the right name. If the block fails, everything is removed.

    Raises:
        OutputError: a file cannot be written, or `path` exists at the end.
    """
    target = path.resolve()
    with _partial_beside(target, path) as partial:
        folder = partial / target.name
        folder.mkdir(parents=True)
        yield folder
        os.rename(folder, target)


def check_new_folder(path: Path) -> None:
    """Check that a folder can be created, before the work is done.

    Raises:
        OutputError: the folder exists, or cannot be created.
    """
    try:
        if path.exists() or path.is_symlink():
            raise OutputError(f"{path}: already exists: expected the name of a new folder")
        if not path.name:
            raise OutputError(f"{path}: expected the name of a new folder")
        _check_target(path)
    except OSError as reason:  # the name is too long, or permission is missing
        raise OutputError(f"{path}: cannot be written: {reason.strerror}") from None


def make_folder(folder: Path) -> None:
    """Create a folder if it is missing.

    Raises:
        OutputError: it cannot be created.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as reason:
        raise OutputError(f"{folder}: cannot be created: {reason.strerror}") from None


def remove_partials() -> None:
    """Remove the files and folders that are being written."""
    for partial in tuple(partials):
        _remove(partial)


def write_text(path: Path, text: str) -> None:
    """Write a UTF-8 text file atomically.

    Raises:
        OutputError: the file cannot be written.
    """
    with atomic_write(path) as partial:
        partial.write_text(text, encoding="utf-8", newline="\n")


def check_target(path: Path) -> None:
    """Check that a file can be written, in a folder that may be missing, before the work is done.

    Raises:
        OutputError: the folder is not writable, or `path` is a folder, a device or a pipe.
    """
    try:
        _check_target(path)
    except OSError as reason:  # the name is too long, or permission is missing
        if reason.filename is None:  # the working directory no longer exists
            raise
        raise OutputError(f"{path}: cannot be written: {reason.strerror}") from None


def check_distinct(writes: Mapping[str, Path | None], reads: Mapping[str, Path | None]) -> None:
    """Reject writing one file twice, or overwriting an input file.

    Files are given by what messages call them; None: not written, or not read.

    Raises:
        OutputError: two of them are the same file.
    """
    known = {os.path.realpath(path): what for what, path in reads.items() if path is not None}
    for what, path in writes.items():
        if path is None:
            continue
        target = os.path.realpath(path)
        if target in known:
            raise OutputError(f"{path}: is {known[target]}: expected another name for {what}")
        known[target] = f"{what} already"


def check_suffix(path: Path, *suffixes: str) -> None:
    """Reject a path whose suffix may belong to another format.

    Raises:
        OutputError: the suffix is not one of `suffixes`.
    """
    if path.suffix.lower() not in suffixes:
        raise OutputError(f"{path}: expected a name that ends in {' or '.join(suffixes)}")


@contextmanager
def _partial_beside(target: Path, path: Path) -> Iterator[Path]:
    """Yield a temporary name in a file's folder; remove it and new, empty folders at the end."""
    partial = target.with_name(f".omnisim-{secrets.token_hex(6)}.partial")
    new_folders: list[Path] = []
    partials[partial] = new_folders
    try:
        new_folders += [folder for folder in target.parents if not folder.exists()]
        target.parent.mkdir(parents=True, exist_ok=True)
        yield partial
    except OSError as reason:
        raise OutputError(f"{path}: cannot be written: {reason.strerror or reason}") from None
    finally:
        _remove(partial)


def _remove(partial: Path) -> None:
    """Remove a file or folder that is being written, and new, empty folders above it."""
    if partial.is_dir() and not partial.is_symlink():
        shutil.rmtree(partial, ignore_errors=True)
    else:
        with suppress(FileNotFoundError, NotADirectoryError):
            partial.unlink()
    for folder in partials.pop(partial, ()):
        with suppress(OSError):  # it is not empty, as is right
            folder.rmdir()


def _check_target(path: Path) -> None:
    if path.is_dir():
        raise OutputError(f"{path}: is a folder: expected the name of a file")
    if path.exists() and not path.is_file():  # a device or a pipe would be replaced by a file
        raise OutputError(f"{path}: is not a regular file: expected the name of a file")
    folder = next((folder for folder in path.parents if folder.exists()), path.parent)
    if not folder.is_dir():
        raise OutputError(f"{folder}: is a file: expected a folder")
    trial = folder / f".omnisim-{secrets.token_hex(6)}.partial"
    try:  # os.access allows root what /proc refuses
        trial.touch()
        trial.unlink()
    except OSError:
        Path.cwd()  # if it no longer exists, that is the fault
        raise OutputError(f"{path}: the folder {folder} cannot be written to") from None


# Finished files of a run.


def is_written(path: Path) -> bool:
    """True if a file exists and is not empty."""
    try:
        return path.stat().st_size > 0
    except FileNotFoundError:
        return False
