"""The command line: parses, calls and prints; no maths."""

INTERRUPTED = 130  # exit status after Ctrl-C, as shells have it
