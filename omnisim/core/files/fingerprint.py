"""Fingerprints of plain data: equal contents have equal fingerprints.

An object with an attribute `given`, the digest of its sources, is fingerprinted by that digest.
"""

from __future__ import annotations

import dataclasses
import hashlib
from collections.abc import Mapping
from enum import Enum
from typing import Any

import numpy as np


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
