"""Consoles: results on standard output; notes, errors and progress on standard error."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from rich.console import Console

from omnisim.core.errors import printable

out = Console(highlight=False, soft_wrap=True, emoji=False)
err = Console(stderr=True, highlight=False, soft_wrap=True, emoji=False)


def print_note(text: str) -> None:
    """Print a note on standard error."""
    err.print(f"note: {printable(text)}", markup=False)


def track(steps: Iterable[int], description: str, total: int) -> Iterator[int]:
    """Yield steps while showing a progress bar, which appears on terminals only."""
    from rich import progress  # slow to import

    yield from progress.track(
        steps, description, total=total, console=err, transient=True, disable=not err.is_terminal
    )


def pluralize(count: int, noun: str) -> str:
    """Format a count with its noun: 1 step, 2 steps."""
    return f"{count} {noun}{'' if count == 1 else 's'}"
