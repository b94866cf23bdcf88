"""Table of the public names in Python, with their sources, for readers on GitHub."""

from __future__ import annotations

import inspect
import re
from importlib import import_module
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "reference" / "api.md"


def python_names() -> str:
    """Markdown table: each name that the page documents, its summary and its source."""
    text = PAGE.read_text(encoding="utf-8")
    rows = [_row(name) for name in re.findall(r"^\.\. auto\w+:: (\S+)$", text, re.MULTILINE)]
    return "\n".join(["| name | summary |", "| --- | --- |", *rows]) + "\n"


def _row(name: str) -> str:
    package, _, attribute = name.rpartition(".")
    value: Any = getattr(import_module(package), attribute)
    if inspect.isclass(value) or inspect.isfunction(value):
        source = inspect.getsourcefile(value)
        summary = (inspect.getdoc(value) or "").partition("\n\n")[0].replace("\n", " ")
    else:  # an alias: the comment above it
        source = import_module(f"{package}.{import_module(package)._MODULES[attribute]}").__file__
        text = Path(str(source)).read_text(encoding="utf-8")
        (summary,) = re.findall(rf"^# (.+)\n{attribute} = ", text, re.MULTILINE)
    path = Path(str(source)).resolve().relative_to(ROOT)
    cell = summary.replace("|", r"\|")
    return f"| [`{name}`](../../{path}) | {cell} |"
