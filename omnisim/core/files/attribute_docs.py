"""Attribute documentation: the string below a field in the source of its class."""

from __future__ import annotations

import ast
import itertools
import sys
from functools import cache


def attribute_docs(model: type) -> dict[str, str]:
    """Strings below the fields of a class and its bases, each in one line, by field name."""
    docs: dict[str, str] = {}
    for kind in reversed(model.__mro__):
        if kind.__module__.startswith("omnisim"):
            docs |= _docs_in(kind.__module__).get(kind.__qualname__, {})
    return docs


@cache
def _docs_in(module: str) -> dict[str, dict[str, str]]:
    """Strings below the fields of a module's classes, by class name and field name."""
    path = sys.modules[module].__file__
    assert path is not None
    with open(path, encoding="utf-8") as file:
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
