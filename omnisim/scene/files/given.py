"""Identity of a scene: digests of what it was made from, never of numbers computed from that."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from omnisim.core.files.sources import source_digest


@dataclass(frozen=True)
class Given:
    """Digests of what a scene was made from: files, keys, options and edits.

    Attributes:
        content: of everything.
        light: of what baked light depends on: static surfaces, materials and lights.
    """

    content: str
    light: str

    def edited(self, *change: Any) -> Given:
        """Digests after an edit, by its name and its arguments."""
        words = [_plain(one) for one in change]
        return Given(source_digest(self.content, *words), source_digest(self.light, *words))


def _plain(value: Any) -> Any:
    """Argument of an edit in the types of JSON: of arrays shape, type and bytes."""
    if value is None or isinstance(value, bool | int | float | str):
        return value
    if isinstance(value, Given):
        return [value.content, value.light]
    array = np.asarray(value)
    return [array.dtype.str, list(array.shape), np.ascontiguousarray(array).tobytes().hex()]
