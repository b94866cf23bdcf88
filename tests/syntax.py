"""Syntax trees of the project's Python files, each parsed and walked once for all tests."""

import ast
import gc
from functools import cache
from pathlib import Path

import omnisim

PACKAGE = Path(omnisim.__file__).parent


@cache
def syntax_nodes(folder=PACKAGE):
    """Nodes of the files below a folder by path, breadth first: a file's tree is its first."""
    # Collecting garbage among a million new nodes takes twice as long as making them.
    gc.disable()
    try:
        return {
            path: list(ast.walk(ast.parse(path.read_text(encoding="utf-8"))))
            for path in sorted(folder.rglob("*.py"))
        }
    finally:
        gc.enable()
