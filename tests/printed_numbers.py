"""Numbers that no command prints: a negative zero, and what rounding leaves of a zero."""

import re

PRINTED_NOISE = re.compile(
    r"(?<![\w.])[-−]0(?:\.0+)?(?![\w.])|(?<![\w.])[-−]?\d(?:\.\d+)?e[-−]1\d\b"
)
