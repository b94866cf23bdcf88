"""Identity of a scene: digests of what it was made from, never of numbers computed from that.

It is set in one place, at the end of `read_scene`; edits continue it (`Scene.altered`). A scene
made of arrays is identified by them, when `Scene.identity` is asked for. The last bits of computed
numbers differ between processors, so they count only where arrays are all that is known.
"""

from __future__ import annotations

import dataclasses
import hashlib
import struct
from dataclasses import dataclass
from enum import Enum
from typing import Any

import numpy as np

from omnisim.core.files.sources import fingerprint, source_digest
from omnisim.scene.light.lighting import background_light
from omnisim.scene.parts import Instance, Lighting, Material, Mesh


@dataclass(frozen=True)
class SourceDigests:
    """Digests of a scene's sources: files, keys, options and edits, or arrays."""

    content: str  # digest of all sources
    light: str  # digest of the inputs of baked light: static surfaces, materials and lights

    def edited(self, *change: Any) -> SourceDigests:
        """Digests after an edit, given by its name and its arguments."""
        plain = [_plain(part) for part in change]
        return SourceDigests(source_digest(self.content, *plain), source_digest(self.light, *plain))

    def baked(self, bake: str) -> SourceDigests:
        """Digests of the scene with baked light, given the digest of its folder."""
        return SourceDigests(source_digest(self.content, bake), self.light)


def _plain(value: Any) -> Any:
    """Argument of an edit as JSON types; an array becomes its type, shape and bytes."""
    if value is None or isinstance(value, bool | int | float | str):
        return value
    if hasattr(value, "given"):  # a scene; of one made of arrays, all counts for the light
        digests = value.given or SourceDigests(*[fingerprint(value)] * 2)
        return [digests.content, digests.light]
    array = np.asarray(value)
    return [array.dtype.str, list(array.shape), np.ascontiguousarray(array).tobytes().hex()]


def light_of_arrays(
    meshes: tuple[Mesh, ...],
    materials: tuple[Material, ...],
    instances: tuple[Instance, ...],
    lighting: Lighting,
    background: tuple[float, float, float],
) -> str:
    """SHA-256 (64 hexadecimal digits) of static geometry, materials, lights and exposure.

    Names, dynamic objects, fog, start poses and backgrounds that emit no light do not count.
    """
    digest = _Digest()
    digest.add(meshes)
    digest.add(materials)
    digest.add(instances)
    digest.add((lighting.ambient, lighting.lights, lighting.exposure, lighting.is_matte))
    digest.add(None if lighting.environment is None else lighting.environment.radiance)
    if any(sky := background_light(background)):
        digest.add(sky)
    return digest.hexdigest()


_NAMES = frozenset(("name", "world_from_node"))  # fields without effect on the light


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
            if id(value) not in self._known:
                hasher = hashlib.sha256(f"{value.dtype.str}{value.shape}".encode())
                hasher.update(np.ascontiguousarray(value).data)
                self._known[id(value)] = value, hasher.digest()  # the reference keeps the id unique
            self._hash.update(self._known[id(value)][1])
        elif isinstance(value, tuple | list):
            self._tag("sequence", len(value))
            for item in value:
                self.add(item)
        elif dataclasses.is_dataclass(value):
            # only fields with non-default values: later versions may have more fields
            for field in dataclasses.fields(value):
                given = getattr(value, field.name)
                is_default = not isinstance(given, np.ndarray) and given == field.default
                if field.name not in _NAMES and not is_default:
                    self._tag("field", field.name)
                    self.add(given)
            self._tag("end", type(value).__name__)
        elif isinstance(value, Enum):
            self._tag("case", value.value)
        elif isinstance(value, bool | int | float):
            self._hash.update(struct.pack("<d", value))
        else:
            self._tag("other", value)

    def _tag(self, kind: str, value: object) -> None:
        self._hash.update(f"{kind} {value!r};".encode())
