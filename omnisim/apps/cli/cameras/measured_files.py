"""Sensor files and reports of `omnisim measure`: values with their standard deviations."""

from __future__ import annotations

import json
import math
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from rich.table import Table

from omnisim.apps.cli.console import out, print_note
from omnisim.core.files.atomic_file import check_distinct, check_suffix, check_target, write_text
from omnisim.core.files.toml_file import Comment, toml_text
from omnisim.measurement.quantity import Quantity, Unseen
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.camera.sensor_toml import sensor_toml


def check_outputs(output: Path, sensor: Path | None, **others: Path) -> None:
    """Check that a measurement's files can be written, before it starts.

    Args:
        output: sensor file to write; its report is written beside it.
        sensor: sensor file to complete.
        others: further files to write, by their name in messages.

    Raises:
        OutputError: a file cannot be written, or would overwrite another one.
    """
    check_suffix(output, ".toml")
    check_target(output)
    written = {"the sensor file": output, "the report": report_path(output)}
    written |= {f"the {name}": path for name, path in others.items()}
    check_distinct(written, {"--sensor": sensor})


def report_path(output: Path) -> Path:
    """Report beside a sensor file."""
    return output.with_suffix(".json")


def sensor_tables(sensor: Path | None) -> dict[str, Any]:
    """Tables of a sensor file to complete, without what its defaults say; empty without one.

    Raises:
        SensorFileError: a fault in the file.
    """
    return {} if sensor is None else tomllib.loads(sensor_toml(OmniCamera.from_file(sensor)))


def write_measured(
    output: Path,
    tables: Mapping[str, Any],
    quantities: Sequence[Quantity],
    unseen: Sequence[Unseen],
    details: Mapping[str, Any],
) -> None:
    """Write a sensor file whose comments give the standard deviations, and a report as JSON.

    Args:
        output: sensor file.
        tables: tables of the sensor file.
        quantities: measured quantities.
        unseen: quantities that the images do not determine.
        details: further entries of the report, JSON values.

    Raises:
        OutputError: a file cannot be written.
    """
    known = [one for one in quantities if math.isfinite(one.sigma)]
    lines = [f"{one.name}: {_number(one)} ({one.basis})" for one in known]
    lines += [f"{one.name}: not measured: {one.reason}" for one in unseen]
    write_text(output, toml_text({f"# {line}": Comment(line) for line in lines} | dict(tables)))
    rows = [
        asdict(one) | {"sigma": one.sigma if math.isfinite(one.sigma) else None}
        for one in quantities
    ]
    report = {"quantities": rows, "not_measured": [asdict(one) for one in unseen], **details}
    write_text(report_path(output), json.dumps(report, indent=2) + "\n")


def print_measured(output: Path, quantities: Sequence[Quantity], unseen: Sequence[Unseen]) -> None:
    """Print the measured quantities as a table, and why others are missing."""
    table = Table(box=None, pad_edge=False)
    for heading in ("", "value", "±", "unit", "from"):
        table.add_column(heading, justify="right" if heading in ("value", "±") else "left")
    for one in quantities:
        table.add_row(one.name, *_columns(one), one.unit, one.basis)
    out.print(f"{output}: written", markup=False)
    out.print(table)
    for missing in unseen:
        print_note(f"{missing.name} not measured: {missing.reason}")


def round_to_sigma(value: float, sigma: float) -> float:
    """Value, rounded to a tenth of its standard deviation."""
    if not math.isfinite(sigma) or sigma <= 0.0:
        return float(f"{value:.6g}")
    return round(value, 1 - math.floor(math.log10(sigma)))


def _columns(quantity: Quantity) -> Sequence[str]:
    """Value and standard deviation of a quantity, as text."""
    if not math.isfinite(quantity.sigma):
        return f"{quantity.value:.3g}", ""
    return f"{round_to_sigma(quantity.value, quantity.sigma):.10g}", f"{quantity.sigma:.2g}"


def _number(quantity: Quantity) -> str:
    return " ± ".join(_columns(quantity)) + f" {quantity.unit}".rstrip()
