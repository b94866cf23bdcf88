"""`omnisim calibration formats`."""

from __future__ import annotations

from rich.console import Console
from rich.table import Table

from omnisim.calibration import FORMATS


def run(out: Console) -> None:
    """List the formats."""
    table = Table(box=None, pad_edge=False)
    for heading in ("format", "what", "file", "cameras", "models that it says exactly"):
        table.add_column(heading)
    for form in FORMATS.values():
        models = "all" if form.is_own else ", ".join(model.model_name for model in form.models)
        table.add_row(
            form.name, form.title, f"*{form.suffix}", "several" if form.several else "one", models
        )
    out.print(table)
    out.print("All are read and written. Another model is fitted, and the file says how near.")
