"""Table of the errors of central models."""

from __future__ import annotations

import math
from collections.abc import Sequence

from rich.table import Table

from omnisim.cameras.central_error import CentralError
from omnisim.core.short_repr import number_text


def error_table(errors: Sequence[CentralError]) -> Table:
    """Table of errors with a row per distance."""
    table = Table(box=None, pad_edge=False)
    table.add_column("at")
    for heading in ("mean", "median", "99 %", "at most", "not shown"):
        table.add_column(heading, justify="right")
    for error in errors:
        values = error.mean_px, error.median_px, error.percentile_99_px, error.max_px
        pixels = ["–" if math.isnan(value) else f"{number_text(value, 3)} px" for value in values]
        table.add_row(error.at, *pixels, f"{100.0 * error.left_out:.1f} %")
    return table
