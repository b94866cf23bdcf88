"""Entries of the table of commands, and how a command runs."""

from __future__ import annotations

import gc
from collections.abc import Mapping
from importlib import import_module
from typing import Any, NamedTuple

from omnisim.core.extras import require_extra


class Entry(NamedTuple):
    """Command of the table.

    Attributes:
        summary: help text.
        run: function in `omnisim.apps.cli`, imported when the command runs; if it returns False,
            the exit status is 1.
        request: class in `omnisim.apps.cli` that defines the options, imported when a command line
            is parsed; empty: no options.
        extra: required extra of the package; None: no extra.
    """

    summary: str
    run: str
    request: str = ""
    extra: str | None = None

    @property
    def request_class(self) -> type | None:
        """Class of the request; None: the command has no options."""
        return self._resolve(self.request) if self.request else None

    def call(self, path: str, request: object | None) -> int:
        """Run the command and return its exit status.

        Args:
            path: name of the command, preceded by its group's.
            request: instance of the request's class, if there is one.

        Raises:
            OmnisimError: a fault that a user can fix.
        """
        if self.extra is not None:
            require_extra(self.extra, f"omnisim {path}")
        run = self._resolve(self.run)
        gc.enable()  # paused while modules are imported, see `app.main`
        result = run() if request is None else run(request)
        return 1 if result is False else 0

    @staticmethod
    def _resolve(name: str) -> Any:
        """Import a function or class from a module of `omnisim.apps.cli`."""
        module, _, attribute = name.rpartition(".")
        return getattr(import_module(f"omnisim.apps.cli.{module}"), attribute)


class GroupEntry(NamedTuple):
    """Group of commands of the table.

    Attributes:
        summary: help text.
        commands: commands by name.
    """

    summary: str
    commands: Mapping[str, Entry]
