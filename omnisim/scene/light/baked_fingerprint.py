"""Fingerprint of the inputs of baked light: static surfaces, their materials, and the light.

For a loaded scene it is computed from files and keys, and is the same on every machine.
"""

from __future__ import annotations

import dataclasses
import hashlib
import struct
from enum import Enum
from typing import Any

import numpy as np

from omnisim.scene.light.lighting import background_light
from omnisim.scene.model import Scene

_NAMES = frozenset(("name", "world_from_node"))  # fields without effect on the light


def baked_fingerprint(scene: Scene) -> str:
    """SHA-256 (64 hexadecimal digits) of the inputs of baked light."""
    return content_fingerprint(scene) if scene.given is None else scene.given.light


def content_fingerprint(scene: Scene) -> str:
    """SHA-256 (64 hexadecimal digits) of static geometry, materials, lights and exposure.

    It hashes computed numbers: for a loaded scene it is reproducible only on the same machine.

    Names, dynamic objects, fog, start poses and backgrounds that emit no light are ignored.
    """
    lighting = scene.lighting
    digest = _Digest()
    digest.add(scene.meshes)
    digest.add(scene.materials)
    digest.add(scene.instances)
    digest.add((lighting.ambient, lighting.lights, lighting.exposure, lighting.is_matte))
    digest.add(None if lighting.environment is None else lighting.environment.radiance)
    if any(sky := background_light(scene.background)):
        digest.add(sky)
    return digest.hexdigest()


class _Digest:
    """Hash of nested plain data; a repeated array is read only once."""

    def __init__(self) -> None:
        self._hash = hashlib.sha256()
        self._known: dict[int, tuple[np.ndarray[Any, Any], bytes]] = {}

    def hexdigest(self) -> str:
        """Digest of all added data."""
        return self._hash.hexdigest()

    def add(self, value: Any) -> None:
        """Add numbers, text, arrays, enumerations, sequences and data classes of these."""
        if isinstance(value, np.ndarray):
            self._hash.update(self._of_array(value))
        elif isinstance(value, tuple | list):
            self._tag("sequence", len(value))
            for one in value:
                self.add(one)
        elif dataclasses.is_dataclass(value):
            self._add_fields(value)
        elif isinstance(value, Enum):
            self._tag("case", value.value)
        elif isinstance(value, bool | int | float):
            self._hash.update(struct.pack("<d", value))
        else:
            self._tag("other", value)

    def _add_fields(self, value: Any) -> None:
        """Add the fields with non-default values only: later versions may have more fields."""
        for field in dataclasses.fields(value):
            given = getattr(value, field.name)
            is_default = not isinstance(given, np.ndarray) and given == field.default
            if field.name not in _NAMES and not is_default:
                self._tag("field", field.name)
                self.add(given)
        self._tag("end", type(value).__name__)

    def _of_array(self, array: np.ndarray[Any, Any]) -> bytes:
        if id(array) not in self._known:
            one = hashlib.sha256(f"{array.dtype.str}{array.shape}".encode())
            one.update(np.ascontiguousarray(array).data)
            self._known[id(array)] = array, one.digest()  # the reference keeps the id unique
        return self._known[id(array)][1]

    def _tag(self, kind: str, value: object) -> None:
        self._hash.update(f"{kind} {value!r};".encode())
