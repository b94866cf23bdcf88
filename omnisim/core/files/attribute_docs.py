"""Attribute documentation: the string below a field in the source of its class."""

from __future__ import annotations

import ast
import itertools
from functools import cache
from importlib.util import find_spec


def attribute_docs(model: type) -> dict[str, str]:
    """Strings below the fields of a class and its bases, each in one line, by field name."""
    docs: dict[str, str] = {}
    for kind in reversed(model.__mro__):
        if kind.__module__.startswith("omnisim"):
            docs |= class_docs(kind.__module__, kind.__qualname__)
    return docs


def class_docs(module: str, name: str) -> dict[str, str]:
    """Strings below the fields of a class, without its bases; it need not be imported."""
    return _docs_in(module).get(name, {})


@cache
def _docs_in(module: str) -> dict[str, dict[str, str]]:
    """Strings below the fields of a module's classes, by class name and field name."""
    spec = find_spec(module)
    assert spec is not None
    assert spec.origin is not None
    with open(spec.origin, encoding="utf-8") as file:
        classes = [one for one in ast.parse(file.read()).body if isinstance(one, ast.ClassDef)]
    return {one.name: _docs_below(one.body) for one in classes}


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
