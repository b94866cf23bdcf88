"""Consoles: results on standard output; notes, errors and progress on standard error."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator
from functools import cached_property
from typing import TYPE_CHECKING, Any

from omnisim.core.errors import printable

if TYPE_CHECKING:
    from rich.console import Console


class Output:
    """Standard output, or standard error; plain text needs no import of rich, which is slow.

    Args:
        is_error: True for standard error.
    """

    def __init__(self, is_error: bool = False):
        self._is_error = is_error

    @cached_property
    def console(self) -> Console:
        """Console for markup, tables and progress bars."""
        from rich.console import Console

        return Console(stderr=self._is_error, highlight=False, soft_wrap=True, emoji=False)

    @property
    def is_terminal(self) -> bool:
        """True on a terminal."""
        return self.console.is_terminal

    def print(self, *what: Any, markup: bool = True, end: str = "\n", **style: Any) -> None:
        """Print texts, tables and so on, as rich's `Console.print` does."""
        stream = sys.stderr if self._is_error else sys.stdout
        is_plain = all(isinstance(one, str) and one.isprintable() for one in what)
        if markup or style or stream is None or not is_plain:
            self.console.print(*what, markup=markup, end=end, **style)
            return
        try:
            print(*what, end=end, file=stream, flush=True)
        except BrokenPipeError:
            self.console.print()  # fails as well, and ends the process quietly


out, err = Output(), Output(is_error=True)


def print_note(text: str) -> None:
    """Print a note on standard error."""
    err.print(f"note: {printable(text)}", markup=False)


def track(steps: Iterable[int], description: str, total: int) -> Iterator[int]:
    """Yield steps while showing a progress bar, which appears on terminals only."""
    from rich import progress  # slow to import

    yield from progress.track(
        steps, description, total=total, console=err.console, transient=True,
        disable=not err.is_terminal,
    )  # fmt: skip


def pluralize(count: int, noun: str) -> str:
    """Format a count with its noun: 1 step, 2 steps."""
    return f"{count} {noun}{'' if count == 1 else 's'}"
