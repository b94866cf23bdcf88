"""Progress bar, drawn only between rounds, so that no thread draws during a measurement."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from rich.console import Console
from rich.markup import escape
from rich.progress import Progress


def show_progress(steps: Iterable[int], what: str, total: int, err: Console) -> Iterator[int]:
    """Iterate over the steps with a progress bar."""
    with Progress(
        console=err, transient=True, auto_refresh=False, disable=not err.is_terminal
    ) as bar:
        task = bar.add_task(escape(what), total=total)
        for step in steps:
            bar.refresh()
            yield step
            bar.advance(task)
