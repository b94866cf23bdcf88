"""Command line: parses arguments, calls the library and prints results."""

TYPE_CHECKING = False
if TYPE_CHECKING:
    from collections.abc import Callable

INTERRUPTED = 130  # exit status after Ctrl-C, as in shells
at_interrupt: "list[Callable[[], str]]" = []  # lines to print when Ctrl-C ends the process
