"""Table of the formats that runs are exported to."""

from __future__ import annotations

from omnisim.datasets.export.export_formats import FORMATS


def export_formats() -> str:
    """Markdown table of the formats."""
    rows = [
        f"| `{name}` | {entry.title} | {'' if entry.extra is None else f'`{entry.extra}`'} |"
        for name, entry in FORMATS.items()
    ]
    return (
        "\n".join(["| format | contents and readers | extra |", "| --- | --- | --- |", *rows])
        + "\n"
    )
