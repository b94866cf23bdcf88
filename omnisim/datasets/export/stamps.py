"""Stamps in the text files of data sets: exact, from integer nanoseconds."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from datetime import UTC, datetime, timedelta

from omnisim.datasets.export.export_format import NANOSECONDS


def seconds_text(stamp_ns: int) -> str:
    """Text of a stamp in seconds since 1970, with nine decimals."""
    seconds, nanoseconds = divmod(stamp_ns, NANOSECONDS)
    return f"{seconds}.{nanoseconds:09d}"


def date_text(stamp_ns: int) -> str:
    """Date and time of day in UTC with nine decimals, as in KITTI's timestamps.txt."""
    seconds, nanoseconds = divmod(stamp_ns, NANOSECONDS)
    moment = datetime(1970, 1, 1, tzinfo=UTC) + timedelta(seconds=seconds)
    return f"{moment:%Y-%m-%d %H:%M:%S}.{nanoseconds:09d}"


def restamped(lines: Iterable[str], stamps: Iterable[str], separator: str) -> Iterator[str]:
    """Lines of a trajectory file, header first, with the first column replaced by exact stamps."""
    rows = iter(lines)
    yield next(rows)
    for line, stamp in zip(rows, stamps, strict=True):
        yield stamp + separator + line.partition(separator)[2]
