"""Progress bars, on a terminal only."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from rich.console import Console
from rich.progress import track


def count_along(steps: Iterable[int], what: str, total: int, err: Console) -> Iterator[int]:
    """The steps themselves, with a bar that says what is done and how far it is."""
    yield from track(
        steps, what, total=total, console=err, transient=True, disable=not err.is_terminal
    )
