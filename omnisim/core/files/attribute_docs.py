"""Attribute documentation: the string below a field in the source of its class."""

from __future__ import annotations

import ast
import itertools
from functools import cache
from importlib.util import find_spec

_FOREIGN = {"abc", "builtins", "enum", "pydantic", "typing"}  # bases whose fields have no help


def attribute_docs(model: type) -> dict[str, str]:
    """Strings below the fields of a class and its bases, each in one line.

    They are by field name; of a table that was made of a class's fields, by key.
    """
    docs: dict[str, str] = {}
    for kind in reversed(model.__mro__):
        source = kind.__dict__.get("fields_of")
        if source is not None:
            key_of = getattr(source, "file_key", str)
            docs |= {key_of(name): text for name, text in attribute_docs(source).items()}
        if kind.__module__.partition(".")[0] not in _FOREIGN:
            docs |= _docs_in(kind.__module__).get(kind.__qualname__, {})
    return docs


@cache
def _docs_in(module: str) -> dict[str, dict[str, str]]:
    """Strings below the fields of a module's classes, by class name and field name."""
    spec = None if module == "__main__" else find_spec(module)
    if spec is None or spec.origin is None:  # a notebook
        return {}
    with open(spec.origin, encoding="utf-8") as file:
        classes = [node for node in ast.parse(file.read()).body if isinstance(node, ast.ClassDef)]
    return {kind.name: _docs_below(kind.body) for kind in classes}


def _docs_below(body: list[ast.stmt]) -> dict[str, str]:
    return {
        field.target.id: " ".join(text.value.value.split())
        for field, text in itertools.pairwise(body)
        if isinstance(field, ast.AnnAssign)
        and isinstance(field.target, ast.Name)
        and isinstance(text, ast.Expr)
        and isinstance(text.value, ast.Constant)
        and isinstance(text.value.value, str)
    }
