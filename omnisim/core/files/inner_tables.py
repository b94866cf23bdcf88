"""Tables nested in the keys of a table, by the annotations of its schema."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple, get_args, get_origin

import pydantic


class InnerTable(NamedTuple):
    """Nested table of a key.

    Attributes:
        model: schema of the nested table.
        is_list: True if the key holds a list of such tables.
    """

    model: type[pydantic.BaseModel]
    is_list: bool


def table_in(annotation: Any) -> InnerTable | None:
    """Nested table of a key, or None."""
    if isinstance(annotation, type) and issubclass(annotation, pydantic.BaseModel):
        return InnerTable(annotation, False)
    is_list = get_origin(annotation) in (tuple, list)
    for part in get_args(annotation):
        table = table_in(part)
        if table is not None:
            return InnerTable(table.model, is_list or table.is_list)
    return None


def headers_with(model: type[pydantic.BaseModel], key: str, path: str = "") -> Iterator[str]:
    """Headers of nested tables that have a key, such as `[light]` and `[[lamps]]`.

    Args:
        model: schema of the outer table.
        key: name of the key.
        path: path of the outer table in its file; empty: the file itself.
    """
    for name, field in model.model_fields.items():
        inner = table_in(field.annotation)
        if inner is None:
            continue
        below = f"{path}.{name}" if path else name
        if key in inner.model.model_fields:
            yield f"[[{below}]]" if inner.is_list else f"[{below}]"
        yield from headers_with(inner.model, key, below)
