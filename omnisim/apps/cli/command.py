"""Commands and groups, built from the entries of a table on demand."""

from __future__ import annotations

import gc
import inspect
from collections.abc import Mapping
from functools import cached_property
from importlib import import_module
from itertools import takewhile
from typing import Any, NamedTuple

import typer
import typer.main
from typer.core import TyperCommand, TyperGroup, TyperOption

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


class GroupEntry(NamedTuple):
    """Group of commands of the table.

    Attributes:
        summary: help text.
        commands: commands by name.
    """

    summary: str
    commands: Mapping[str, Entry]


class Command(TyperCommand):
    """Command built from an entry of the table.

    Args:
        path: name of the command, preceded by its group's.
        entry: entry of the table.
        panel: heading on the help page of its group.
    """

    def __init__(self, path: str, entry: Entry, panel: str | None = None):
        self._path, self._entry = path, entry
        name = path.rpartition(" ")[2]
        super().__init__(name, callback=self._call, help=entry.summary, rich_help_panel=panel)
        self.context_settings = {
            "help_option_names": ["-h", "--help"],
            "allow_extra_args": True,  # rejected below, in the same words as others
        }

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Parse the words after the command's name.

        Raises:
            CommandLineError: one line that names an option, and what is expected.
        """
        if ctx.resilient_parsing:  # for completion
            return super().parse_args(ctx, args)
        from omnisim.apps.cli.usage_errors import CommandLine, UsageError

        line = CommandLine(f"omnisim {self._path}", self._request, args)
        line.check_words()
        try:
            rest = super().parse_args(ctx, args)
        except UsageError as error:
            raise line.error(error) from None
        line.check_values(ctx.params, rest)
        return rest

    @property
    def params(self) -> list[Any]:
        """Options and arguments, read from the request on demand."""
        params: list[Any] = self._built.params
        return params

    @params.setter
    def params(self, none: list[Any]) -> None:
        """Ignore the empty list that the constructor assigns."""

    def get_params(self, *context: Any) -> list[Any]:  # noqa: D102 - click's, or typer's copy of it
        return _without_flag_types(super().get_params(*context))

    def _call(self, **values: object) -> object:
        assert self._built.callback is not None
        return self._built.callback(**values)

    @cached_property
    def _request(self) -> Any:
        """Class that defines the options; None: no options."""
        return _resolve(self._entry.request) if self._entry.request else None

    @cached_property
    def _built(self) -> Any:
        """Typer command with the request's parameters."""
        from omnisim.apps.cli.options import make_request, parameters

        request = self._request

        def call(**values: object) -> None:
            if self._entry.extra is not None:
                require_extra(self._entry.extra, f"omnisim {self._path}")
            run = _resolve(self._entry.run)
            gc.freeze()  # what is imported stays: collections need not look at it
            gc.enable()  # start.py disables it
            try:
                result = run() if request is None else run(make_request(request, values))
            finally:
                gc.unfreeze()  # OpenImageIO reports types that are never collected
            if result is False:
                raise typer.Exit(1)

        options = {} if request is None else parameters(request)
        call.__signature__ = inspect.Signature(list(options.values()))  # type: ignore[attr-defined]
        app = typer.Typer(add_completion=False)
        app.command()(call)
        return typer.main.get_command(app)


class Group(TyperGroup):
    """Group whose help page shows flags without a value type."""

    def get_params(self, *context: Any) -> list[Any]:  # noqa: D102 - click's, or typer's copy of it
        return _without_flag_types(super().get_params(*context))

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Parse the options before a command's name, and find the command.

        Raises:
            CommandLineError: an unknown option or command.
        """
        words = list(takewhile(lambda word: word.startswith("-"), args)) or args[:1]
        flags = [flag for one in self.get_params(ctx) for flag in one.opts]
        for word in () if ctx.resilient_parsing else words:
            noun, known = ("option", flags) if word.startswith("-") else ("command", self.commands)
            if word.partition("=")[0] not in known:
                from omnisim.apps.cli.usage_errors import unknown

                raise unknown(word, noun, ctx.command_path, known)
        return super().parse_args(ctx, args)


class DefaultGroup(Group):
    """Group that runs its command `show` if the first argument names no command."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:  # noqa: D102 - click's
        if args and args[0] not in self.commands and args[0] not in ctx.help_option_names:
            args = ["show", *args]
        return super().parse_args(ctx, args)

    def shell_complete(self, ctx: Any, incomplete: str) -> list[Any]:  # noqa: D102 - click's
        show = self.commands["show"]
        argument = next(one for one in show.params if one.param_type_name == "argument")
        commands: list[Any] = super().shell_complete(ctx, incomplete)
        return commands + list(argument.shell_complete(ctx, incomplete))


def make_commands(
    table: Mapping[str, Mapping[str, Entry | GroupEntry]],
) -> dict[str, Command | Group]:
    """Build the commands and groups of a table, by name.

    Args:
        table: entries by name, grouped by heading of the help page.
    """
    return {
        name: _make_group(name, entry, panel)
        if isinstance(entry, GroupEntry)
        else Command(name, entry, panel)
        for panel, entries in table.items()
        for name, entry in entries.items()
    }


def _make_group(name: str, entry: GroupEntry, panel: str) -> Group:
    kind = DefaultGroup if "show" in entry.commands and name == "scene" else Group
    commands: dict[str, Any] = {
        child: Command(f"{name} {child}", one) for child, one in entry.commands.items()
    }
    return kind(
        name=name, commands=commands, help=entry.summary, rich_help_panel=panel,
        no_args_is_help=True, context_settings={"help_option_names": ["-h", "--help"]},
    )  # fmt: skip


def _without_flag_types(parameters: list[Any]) -> list[Any]:
    for parameter in parameters:
        if isinstance(parameter, TyperOption) and parameter.is_flag and parameter.metavar is None:
            parameter.metavar = ""
    return parameters


def _resolve(name: str) -> Any:
    """Import a function or class from a module of `omnisim.apps.cli`."""
    module, _, attribute = name.rpartition(".")
    return getattr(import_module(f"omnisim.apps.cli.{module}"), attribute)
