"""Readers that remember the input files: their digest identifies a result on any machine.

The last bits of computed numbers differ between processors. Identity is therefore a digest of the
inputs: bytes of files, keys and values of tables, options.

A scene's files go through a reader that its loader passes on. Files of cameras, which are nested in
many ways, are remembered by `recorded_sources`.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from enum import Enum
from pathlib import Path
from typing import Any

import numpy as np

NOT_IDENTITY = {"identity": False}  # metadata of a dataclass field that fingerprints leave out
VERSION = 1  # version of the record; a new one gives new digests


class SourceReader:
    """Reader of input files that remembers the digest of each."""

    def __init__(self) -> None:
        self._digests: dict[Path, str] = {}

    def read(self, path: Path) -> bytes:
        """Content of a file.

        Raises:
            OSError: the file cannot be read.
        """
        data = path.read_bytes()
        self.add(path, hashlib.sha256(data).hexdigest())
        return data

    def note(self, path: Path) -> Path:
        """Path of a file that a library reads itself, which reports one that cannot be read."""
        with suppress(OSError), path.open("rb") as file:
            self.add(path, hashlib.file_digest(file, "sha256").hexdigest())
        return path

    def note_table(self, path: Path, table: Mapping[str, Any]) -> None:
        """Remember a file by its keys and values; comments and layout do not count."""
        self.add(path, source_digest(table))

    def digest(self, root: Path) -> str:
        """SHA-256 (64 hexadecimal digits) of all files, by their paths relative to a folder.

        A file outside the folder is identified by its own name and its folder's name, so its
        location on the machine does not matter.
        """
        root = root.absolute()
        files = sorted((_label(path, root), digest) for path, digest in self._digests.items())
        return source_digest(VERSION, files)

    def add(self, path: Path, digest: str) -> None:
        """Remember a file; only the first digest of a path counts."""
        self._digests.setdefault(path.absolute(), digest)

    def update(self, other: SourceReader) -> None:
        """Remember the files of another reader."""
        for path, digest in other._digests.items():
            self.add(path, digest)


_recorder: ContextVar[SourceReader | None] = ContextVar("recorder", default=None)


@contextmanager
def recorded_sources() -> Iterator[SourceReader]:
    """Remember the files of cameras read within the block; an enclosing block does, too."""
    sources, outer = SourceReader(), _recorder.get()
    token = _recorder.set(sources)
    try:
        yield sources
    finally:
        _recorder.reset(token)
        if outer is not None:
            outer.update(sources)


def note_bytes(path: Path, data: bytes) -> None:
    """Record a file with the given content."""
    recorder = _recorder.get()
    if recorder is not None:
        recorder.add(path, hashlib.sha256(data).hexdigest())


def note_file(path: Path) -> None:
    """Record a file that a library reads itself; does nothing if it cannot be read."""
    recorder = _recorder.get()
    if recorder is not None:
        recorder.note(path)


def note_table(path: Path, table: Mapping[str, Any]) -> None:
    """Record a file of keys and values; comments and layout do not count."""
    recorder = _recorder.get()
    if recorder is not None:
        recorder.note_table(path, table)


def source_digest(*parts: Any) -> str:
    """SHA-256 (64 hexadecimal digits) of plain values of JSON and TOML types."""
    text = json.dumps(parts, sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()


def _label(path: Path, root: Path) -> str:
    if path.is_relative_to(root):
        return path.relative_to(root).as_posix()
    return f"{path.parent.name}/{path.name}"


# Fingerprints of plain data: equal contents have equal fingerprints.
#
# An object with an attribute `given`, the digest of its sources, is fingerprinted by that digest.


def fingerprint(*contents: Any) -> str:
    """SHA-256 of plain data, shortened to 16 hexadecimal digits.

    Accepts dataclasses, tuples, lists, mappings, enums, NumPy arrays, numbers, strings and None.

    Raises:
        TypeError: the data has another type.
    """
    digest = hashlib.sha256()
    _feed(digest, contents, {})
    return digest.hexdigest()[:16]


def _feed(digest: Any, value: Any, seen: dict[int, bytes]) -> None:
    given = getattr(value, "given", None)
    if given is not None:  # identified by its inputs
        digest.update(f"given {given}".encode())
    elif isinstance(value, np.ndarray):
        digest.update(f"array {value.dtype.str} {value.shape}".encode())
        digest.update(np.ascontiguousarray(value).tobytes())
    elif dataclasses.is_dataclass(value) and not isinstance(value, type):
        # many materials may share a texture: its bytes are hashed once
        if id(value) not in seen:
            inner = hashlib.sha256(type(value).__name__.encode())
            for field in dataclasses.fields(value):
                if field.metadata == NOT_IDENTITY:
                    continue
                inner.update(field.name.encode())
                _feed(inner, getattr(value, field.name), seen)
            seen[id(value)] = inner.digest()
        digest.update(seen[id(value)])
    elif isinstance(value, tuple | list):
        digest.update(f"list {len(value)}".encode())
        for item in value:
            _feed(digest, item, seen)
    elif isinstance(value, Mapping):
        digest.update(f"map {len(value)}".encode())
        for key, item in value.items():
            _feed(digest, key, seen)
            _feed(digest, item, seen)
    elif isinstance(value, Enum):
        digest.update(f"enum {value.name}".encode())
    elif value is None or isinstance(value, bool | int | float | str):
        digest.update(f"{type(value).__name__} {value!r}".encode())
    else:
        raise TypeError(f"cannot take the fingerprint of {type(value).__name__}")
