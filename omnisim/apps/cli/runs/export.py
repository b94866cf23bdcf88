"""`omnisim export`."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path

from omnisim.apps.cli.console import out, pluralize, print_note, track
from omnisim.apps.cli.runs.requests import ExportRequest
from omnisim.core.errors import OutputError
from omnisim.datasets.export.export import export_run
from omnisim.datasets.export.export_format import MAX_S, NANOSECONDS, ExportSettings


def run(request: ExportRequest) -> None:
    """Export a run for other tools."""
    start_ns = parse_start_time(request.start_time)
    clouds = request.with_points, request.cloud_layout
    settings = ExportSettings(start_ns, request.compressed, *clouds, not request.without_map)
    where = request.run, request.format, request.output
    steps = export_run(*where, settings, request.camera_name, print_note)
    total = next(steps)
    done = sum(1 for _ in track(steps, "exporting", total))
    size_mb = folder_bytes(request.output) / 1e6
    out.print(f"{request.output}: {request.format}, {pluralize(done, 'step')}, {size_mb:.1f} MB")


def parse_start_time(text: str) -> int:
    """Parse seconds since 1970, or an ISO 8601 date and time (else UTC), to nanoseconds."""
    try:
        whole, dot, decimals = text.strip().partition(".")
        if whole.isdecimal() and (decimals.isdecimal() or not dot):
            start_ns = int(whole) * NANOSECONDS + int(f"{decimals:0<9}"[:9])
        else:
            moment = datetime.fromisoformat(text.strip())
            zoned = moment if moment.tzinfo else moment.replace(tzinfo=UTC)
            since = zoned - datetime(1970, 1, 1, tzinfo=UTC)
            start_ns = (since.days * 86_400 + since.seconds) * NANOSECONDS
            start_ns += since.microseconds * 1000
    except (ValueError, OverflowError):
        start_ns = -1
    if not 0 <= start_ns <= MAX_S * NANOSECONDS:
        expected = "expected seconds since 1970, or a date such as 2026-01-31T12:00:00"
        raise OutputError(f"--start-time {text!r}: {expected}")
    return start_ns


def folder_bytes(folder: Path) -> int:
    """Total size of all files in a folder, bytes."""
    return sum(file.stat().st_size for file in folder.rglob("*") if file.is_file())
