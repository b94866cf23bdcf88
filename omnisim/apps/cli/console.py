"""Consoles: results on standard output; notes, errors and progress on standard error."""

from __future__ import annotations

import shutil
import sys
import textwrap
import time
from collections.abc import Callable, Iterable, Iterator, Sized
from contextlib import contextmanager
from functools import cached_property
from typing import TYPE_CHECKING, Any, TypeVar

from omnisim.apps.cli import at_interrupt
from omnisim.core.errors import printable

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

T = TypeVar("T")


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
        stream = sys.stderr if self._is_error else sys.stdout
        return stream is not None and stream.isatty()

    def print(self, *what: Any, markup: bool = False, end: str = "\n", **style: Any) -> None:
        """Print texts, tables and so on, as rich's `Console.print` does."""
        stream = sys.stderr if self._is_error else sys.stdout
        is_plain = all(isinstance(text, str) and text.isprintable() for text in what)
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
    err.print(f"note: {printable(text)}")


def track(steps: Iterable[T], description: str, total: int | None = None) -> Iterator[T]:
    """Yield steps, of which there are `total`, while showing a bar of progress."""
    count = total if total is not None else len(steps) if isinstance(steps, Sized) else 0
    with progress(description, count) as show:
        for done, step in enumerate(steps):
            show(done, "")
            yield step


@contextmanager
def progress(title: str, total: int, unit: str = "") -> Iterator[Callable[[int, str], None]]:
    """Show a bar of progress while the block runs, on terminals only.

    Args:
        total: number of steps.
        unit: noun of the steps in the plural, for the rate; empty: no rate.

    Yields:
        Function that shows the number of steps done, below a new title unless it is empty.
    """
    if not err.is_terminal:
        yield lambda done, title: None
        return
    from rich import progress as bars

    columns = (
        bars.TextColumn("{task.description}", markup=False),
        bars.BarColumn(bar_width=32),
        bars.MofNCompleteColumn(),
        bars.TextColumn("{task.fields[rate]}", style="cyan"),
        bars.TimeRemainingColumn(),
    )
    begin: tuple[int, float] | None = None
    with bars.Progress(*columns, console=err.console, transient=True) as bar:
        task = bar.add_task(title, total=total, rate="")

        def show(done: int, title: str) -> None:
            nonlocal begin
            begin = begin or (done, time.monotonic())
            seconds = time.monotonic() - begin[1]
            rate = f"{(done - begin[0]) / seconds:.1f} {unit}/s" if unit and seconds else ""
            bar.update(task, completed=done, rate=rate, description=title or None)

        yield show


@contextmanager
def resumable(state: Callable[[], str]) -> Iterator[None]:
    """Say what is done, and how to resume, if Ctrl-C ends the process in the block."""
    at_interrupt.append(state)
    try:
        yield
    finally:
        at_interrupt.remove(state)


def table(*headings: str) -> Table:
    """Table without lines; a heading that begins with > is that of numbers."""
    from rich.table import Table

    shown = Table(box=None, pad_edge=False)
    for heading in headings:
        is_number = heading.startswith(">")
        shown.add_column(heading.removeprefix(">"), justify="right" if is_number else "left")
    return shown


def pluralize(count: int, noun: str) -> str:
    """Format a count with its noun: 1 step, 2 steps."""
    return f"{count} {noun}{'' if count == 1 else 's'}"


def wrapped(text: str, head: str = "") -> str:
    """Text after a head, in lines of a terminal's width; elsewhere one line."""
    if not out.is_terminal:
        return head + text
    return textwrap.fill(
        head + text, shutil.get_terminal_size().columns, subsequent_indent=" " * len(head),
        break_long_words=False, break_on_hyphens=False,
    )  # fmt: skip
