"""Command line: parses arguments, calls the library and prints results."""

INTERRUPTED = 130  # exit status after Ctrl-C, as in shells
