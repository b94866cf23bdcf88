"""Reference of the errors that omnisim raises, from their classes."""

from __future__ import annotations

import inspect

from omnisim.core import errors

_HEADER = """# Errors

Every error of omnisim is an `omnisim.OmnisimError`. Its text is one line for each fault: the file,
the key, the value, and what was expected. The command line prints it and ends with status 1.

| class | raised for |
| --- | --- |
"""


def errors_page() -> str:
    """Markdown of all error classes."""
    kinds = [
        kind
        for kind in vars(errors).values()
        if inspect.isclass(kind) and issubclass(kind, errors.OmnisimError)
    ]
    rows = [f"| `{kind.__name__}` | {inspect.getdoc(kind).splitlines()[0]} |" for kind in kinds]
    return _HEADER + "\n".join(rows) + "\n"
