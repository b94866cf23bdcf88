"""CSV files of measurements with leading comment lines of metadata."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from omnisim.core.files.atomic_file import write_text


def write_commented_csv(
    path: str | Path, header: Mapping[str, Any], columns: str, rows: Iterable[str]
) -> None:
    """Atomically write `# key: value` lines with JSON values, the column names, and the rows.

    Raises:
        OutputError: the file cannot be written.
    """
    comments = (
        f"# {key}: {json.dumps(value, ensure_ascii=False)}" for key, value in header.items()
    )
    write_text(Path(path), "\n".join((*comments, columns, *rows)) + "\n")
