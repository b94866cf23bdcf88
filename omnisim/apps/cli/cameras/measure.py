"""`omnisim measure`: cameras measured from their own images."""

from __future__ import annotations

import json
import math
import tomllib
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from rich.table import Table

from omnisim.apps.cli.cameras.requests import MeasureNoiseRequest
from omnisim.apps.cli.console import out, print_note, track
from omnisim.core.files.atomic_file import check_distinct, check_suffix, check_target, write_text
from omnisim.core.files.toml_file import Comment, toml_text
from omnisim.measurement.noise import (
    FrameStatistics,
    MeasuredNoise,
    find_frame_sets,
    measure_noise,
    read_statistics,
)
from omnisim.measurement.quantity import Quantity
from omnisim.rendering.camera.degradations.fixed_pattern import write_pattern
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.camera.sensor_toml import sensor_toml


def noise(request: MeasureNoiseRequest) -> None:
    """Measure noise, write a sensor file with its pattern, and print the quantities.

    Raises:
        MeasurementError: frames that cannot be measured.
        SensorFileError: a sensor file with a fault.
        OutputError: a file that cannot be written.
    """
    check_suffix(request.output, ".toml")
    check_target(request.output)
    report = request.output.with_suffix(".json")
    pattern = request.output.with_name(f"{request.output.stem}-pattern.exr")
    written = {"the sensor file": request.output, "the report": report, "the pattern": pattern}
    check_distinct(written, {"--sensor": request.sensor})
    tables: dict[str, Any] = {}
    if request.sensor is not None:
        tables = tomllib.loads(sensor_toml(OmniCamera.from_file(request.sensor)))
    measured = measure_noise(
        _statistics(request.dark, "Dark frames"),
        _statistics(request.flat, "Flat fields"),
        bit_depth=request.bit_depth,
        mosaic=request.bayer,
    )
    keys = _keys(measured)
    if measured.pattern is not None:
        write_pattern(pattern, measured.pattern)
        keys["pattern"] = pattern.name
    write_text(request.output, _sensor_text(tables, keys, measured))
    write_text(report, json.dumps(_report(measured), indent=2) + "\n")
    _print(measured, request.output)


def _statistics(folder: Path, title: str) -> list[FrameStatistics]:
    sets = find_frame_sets(folder)
    return [read_statistics(sets[number]) for number in track(range(len(sets)), title, len(sets))]


def _keys(measured: MeasuredNoise) -> dict[str, Any]:
    """Keys of the table `[degradation.noise]`, with no more digits than were measured."""
    digits = {one.name: _rounded(one.value, one.sigma) for one in measured.quantities}
    keys = {key: digits.get(key, value) for key, value in measured.noise.values().items()}
    if measured.pattern is not None:  # which has both
        keys = {key: value for key, value in keys.items() if key not in ("prnu", "dsnu_e")}
    return {key: value for key, value in keys.items() if key != "pattern_seed"}


def _rounded(value: float, sigma: float) -> float:
    """Value, rounded to a tenth of its standard deviation."""
    if not math.isfinite(sigma) or sigma <= 0.0:
        return float(f"{value:.6g}")
    return round(value, 1 - math.floor(math.log10(sigma)))


def _sensor_text(tables: dict[str, Any], keys: dict[str, Any], measured: MeasuredNoise) -> str:
    degradation = {**tables.get("degradation", {}), "noise": keys}
    shutter = degradation.setdefault("shutter", {})
    shutter.setdefault("exposure_s", measured.exposure_s)  # which the dark current needs
    known = [one for one in measured.quantities if math.isfinite(one.sigma)]
    lines = [f"{one.name}: {_number(one)} ({one.basis})" for one in known]
    lines += [f"{one.name}: not measured: {one.reason}" for one in measured.unseen]
    comments = {f"# {line}": Comment(line) for line in lines}
    return toml_text(comments | {**tables, "degradation": degradation})


def _report(measured: MeasuredNoise) -> dict[str, Any]:
    """Report as JSON: unknown standard deviations are null."""
    curve = measured.curve
    quantities = [
        asdict(one) | {"sigma": one.sigma if math.isfinite(one.sigma) else None}
        for one in measured.quantities
    ]
    return {
        "quantities": quantities,
        "not_measured": [asdict(one) for one in measured.unseen],
        "photon_transfer": {
            "mean_dn": curve.means_dn.tolist(),
            "variance_dn2": curve.variances_dn2.tolist(),
            "used": curve.used.tolist(),
        },
        "defective_pixels": measured.defects[:, ::-1].tolist(),
    }


def _print(measured: MeasuredNoise, output: Path) -> None:
    table = Table(box=None, pad_edge=False)
    for heading in ("", "value", "±", "unit", "from"):
        table.add_column(heading, justify="right" if heading in ("value", "±") else "left")
    for one in measured.quantities:
        table.add_row(one.name, *_columns(one), one.unit, one.basis)
    out.print(f"{output}: written", markup=False)
    out.print(table)
    if len(measured.defects):
        out.print(f"{len(measured.defects)} defective pixels", markup=False)
    for unseen in measured.unseen:
        print_note(f"{unseen.name} not measured: {unseen.reason}")


def _columns(quantity: Quantity) -> Sequence[str]:
    """Value and standard deviation of a quantity, as text."""
    if not math.isfinite(quantity.sigma):
        return f"{quantity.value:.3g}", ""
    return f"{_rounded(quantity.value, quantity.sigma):g}", f"{quantity.sigma:.2g}"


def _number(quantity: Quantity) -> str:
    return " ± ".join(_columns(quantity)) + f" {quantity.unit}".rstrip()
