"""`omnisim measure plan`: measures all parts of a camera, and writes one report."""

from __future__ import annotations

import dataclasses
import hashlib
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pydantic
from pydantic import Field

from omnisim.apps.cli.console import out
from omnisim.apps.cli.measure import measured_files as files
from omnisim.apps.cli.measure import requests
from omnisim.apps.cli.measure.measure_compare import compare
from omnisim.apps.cli.measure.measure_geometry import geometry
from omnisim.apps.cli.measure.measure_sensor import noise, response, sharpness, timing
from omnisim.apps.cli.options import request_fields
from omnisim.core.errors import MeasurementError
from omnisim.core.extras import require_extra
from omnisim.core.files.parameters import Table, parse_table
from omnisim.core.files.toml_file import read_tables
from omnisim.measurement.inputs import without_topic

# Commands that measure the parts of a plan, and their requests, in this order: the timing needs the
# transfer function, the sharpness the camera model, too.
_PARTS: dict[str, tuple[Callable[[Any], None], type]] = {
    "geometry": (geometry, requests.MeasureGeometryRequest),
    "response": (response, requests.MeasureResponseRequest),
    "timing": (timing, requests.MeasureTimingRequest),
    "sharpness": (sharpness, requests.MeasureSharpnessRequest),
    "noise": (noise, requests.MeasureNoiseRequest),
}
_COMPARE = "compare"
_OWN = ("output", "sensor")  # which the plan's command sets
_NAME_OR_FILE = ("board", "scene")


def plan(request: requests.MeasurePlanRequest) -> bool:
    """Measure the parts of a plan one after the other, and write a report of them.

    A part whose arguments and files are unchanged since the last call is not measured again.
    Returns False if the comparison misses a bound.
    """
    require_extra("reports", "omnisim measure plan", MeasurementError)
    from omnisim.report.report import Report, check_report_target

    folder = request.output.with_name(f"{request.output.stem}-report")
    files.check_outputs(request.output, request.sensor)
    if request.sensor is not None and request.sensor.resolve() == request.output.resolve():
        raise MeasurementError(f"--sensor: {request.sensor} is the output: expected another file")
    check_report_target(folder)
    read = _with_board(read_tables(request.plan, MeasurementError), request.output)
    parsed = parse_table(read, plan_schema(), MeasurementError, str(request.plan))
    place = request.plan.parent
    tables = {name: _below(place, dict(table)) for name, table in parsed if table is not None}
    if not tables.keys() & _PARTS.keys():
        raise MeasurementError(f"{request.plan}: expected a table of {', '.join(_PARTS)}")
    digest, sensor = _digest("", {"sensor": request.sensor}), request.sensor
    for name, (measure, request_of) in _PARTS.items():
        if name not in tables:
            continue
        digest = _digest(digest, tables[name])
        if files.read_reports(request.output).get(name, {}).get("inputs") == digest:
            out.print(f"{name}: already measured")
        else:
            out.print(name, style="bold")
            with _named(f"{request.plan}: {name}"):
                measure(request_of(**tables[name], output=request.output, sensor=sensor))
            files.mark_inputs(request.output, name, digest)
        sensor = request.output
    if _COMPARE in tables:
        out.print(_COMPARE, style="bold")
        with _named(f"{request.plan}: {_COMPARE}"):
            compared = requests.MeasureCompareRequest(
                **tables[_COMPARE], output=folder, sensor=request.output
            )
            return compare(compared)

    sections = files.measured_sections(request.output)
    Report("Measured camera", "", sections, {"sensor": request.output.name}).write(folder)
    out.print(f"{folder}: written")
    return True


@contextmanager
def _named(place: str) -> Iterator[None]:
    """Name the plan and its table in errors of a part, which names options of its command."""
    try:
        yield
    except MeasurementError as reason:
        raise MeasurementError(f"{place}: {reason}") from None


def plan_schema() -> type[Table]:
    """Schema of a plan: a table for each part."""
    kinds = {name: request for name, (_, request) in _PARTS.items()}
    kinds[_COMPARE] = requests.MeasureCompareRequest
    tables: dict[str, Any] = {}
    for name, kind in kinds.items():
        fields: dict[str, Any] = {}
        for field in request_fields(kind):
            if field.name not in _OWN:  # which the plan sets itself
                default = ... if field.default is dataclasses.MISSING else field.default
                limits: dict[str, Any] = field.limits
                fields[field.name] = (field.kind, Field(default, **limits))
        table = pydantic.create_model(kind.__name__, __base__=Table, **fields)
        table.fields_of = kind
        tables[name] = (table | None, None)
    return pydantic.create_model("Plan", __base__=Table, **tables)


def _with_board(read: Mapping[str, Any], output: Path) -> dict[str, Any]:
    """Tables of a plan, with the geometry's images as defaults of sharpness and comparison."""
    tables = dict(read)
    board = read.get("geometry")
    if not isinstance(board, Mapping) or "images" not in board:
        return tables
    given = {key: board[key] for key in ("images", "board", "mirrored") if key in board}
    comparison = read.get(_COMPARE)
    if isinstance(comparison, Mapping) and "scene" not in comparison:
        tables[_COMPARE] = given | dict(comparison)
    edges = read.get("sharpness")
    if isinstance(edges, Mapping) and "images" not in edges:
        corners = output.with_name(f"{output.stem}-corners.csv").absolute()
        tables["sharpness"] = {"images": board["images"], "corners": str(corners), **edges}
    return tables


def _below(folder: Path, table: dict[str, Any]) -> dict[str, Any]:
    """Table with relative paths resolved from the plan's folder."""
    resolved = {
        key: folder / value if isinstance(value, Path) else value for key, value in table.items()
    }
    for key in _NAME_OR_FILE:
        name = resolved.get(key)
        if isinstance(name, str) and Path(name).suffix and (folder / name).is_file():
            resolved[key] = str(folder / name)
    return resolved


def _digest(before: str, table: Mapping[str, Any]) -> str:
    """Digest of a part's arguments and files, and of the parts before it."""
    digest = hashlib.sha256(before.encode())
    for key, value in sorted(table.items()):
        is_path = isinstance(value, Path)
        digest.update(f"{key} = {value.name if is_path else value!r}\n".encode())
        if not is_path:
            continue
        value = without_topic(value)
        for file in sorted(value.rglob("*")) if value.is_dir() else [value]:
            if file.is_file():
                digest.update(f"{file.relative_to(value)}\n".encode())
                digest.update(file.read_bytes())
    return digest.hexdigest()[:16]
