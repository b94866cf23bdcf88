"""Identity of a scene: digests of its sources, never of numbers computed from them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from omnisim.core.files.sources import source_digest


@dataclass(frozen=True)
class SourceDigests:
    """Digests of a scene's sources: files, keys, options and edits."""

    content: str  # digest of all sources
    light: str  # digest of the inputs of baked light: static surfaces, materials and lights

    def edited(self, *change: Any) -> SourceDigests:
        """Digests after an edit, given by its name and its arguments."""
        plain = [_plain(one) for one in change]
        return SourceDigests(source_digest(self.content, *plain), source_digest(self.light, *plain))


def _plain(value: Any) -> Any:
    """Argument of an edit as JSON types; an array becomes its type, shape and bytes."""
    if value is None or isinstance(value, bool | int | float | str):
        return value
    if isinstance(value, SourceDigests):
        return [value.content, value.light]
    array = np.asarray(value)
    return [array.dtype.str, list(array.shape), np.ascontiguousarray(array).tobytes().hex()]
