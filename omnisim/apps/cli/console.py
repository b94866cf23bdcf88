"""Consoles: results on standard output; notes, errors and progress on standard error."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable, Iterator
from functools import cached_property
from typing import TYPE_CHECKING, Any

from omnisim.core.errors import printable

if TYPE_CHECKING:  # slow to import, and not needed for plain text
    import rich.console

# Control characters that rich removes: bell, backspace, vertical tab, form feed, carriage return.
_REMOVED = dict.fromkeys((7, 8, 11, 12, 13))


class Console:
    """Console that prints plain text itself, and leaves tables, styles and progress to rich.

    Args:
        stderr: print on standard error instead of standard output.
    """

    def __init__(self, stderr: bool = False):
        self._stderr = stderr

    @cached_property
    def rich(self) -> rich.console.Console:
        """Console of rich; once it exists it prints everything, because it may show progress."""
        from rich.console import Console as RichConsole

        return RichConsole(stderr=self._stderr, highlight=False, soft_wrap=True, emoji=False)

    @property
    def is_terminal(self) -> bool:
        """The output is shown by a terminal."""
        return self.rich.is_terminal

    def print(self, *objects: Any, markup: bool = True, end: str = "\n", **options: Any) -> None:
        """Print text, or anything that rich prints, with its options."""
        texts = [one for one in objects if isinstance(one, str)]
        is_plain = "rich" not in self.__dict__ and len(texts) == len(objects) and not options
        if not is_plain or any("\t" in one or (markup and "[" in one) for one in texts):
            self.rich.print(*objects, markup=markup, end=end, **options)
            return
        stream = sys.stderr if self._stderr else sys.stdout
        if stream is None:  # closed
            return
        try:
            stream.write(" ".join(texts).translate(_REMOVED) + end)
            stream.flush()
        except BrokenPipeError:  # as rich does
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            raise SystemExit(1) from None

    def print_error(self, line: str) -> None:
        """Print a line after `error:`, in bold red on a terminal."""
        stream = sys.stderr if self._stderr else sys.stdout
        if stream is None or not stream.isatty():
            self.print(f"error: {line}", markup=False)
            return
        from rich.markup import escape

        self.rich.print(f"[bold red]error:[/] {escape(line)}")


out = Console()
err = Console(stderr=True)


def print_note(text: str) -> None:
    """Print a note on standard error."""
    err.print(f"note: {printable(text)}", markup=False)


def track(steps: Iterable[int], description: str, total: int) -> Iterator[int]:
    """Yield steps while showing a progress bar, which appears on terminals only."""
    from rich import progress  # slow to import

    console = err.rich
    yield from progress.track(
        steps,
        description,
        total=total,
        console=console,
        transient=True,
        disable=not console.is_terminal,
    )


def pluralize(count: int, noun: str) -> str:
    """Format a count with its noun: 1 step, 2 steps."""
    return f"{count} {noun}{'' if count == 1 else 's'}"
