"""Commands whose parameters are the fields of a record."""

import inspect
from collections.abc import Callable
from typing import Any, TypeVar, get_args

import typer
from typer.core import TyperCommand, TyperGroup, TyperOption

Request = TypeVar("Request")


class Command(TyperCommand):
    """Command whose help names the values of its options, and no type after a flag."""

    def get_params(self, *context: Any) -> list[Any]:  # noqa: D102 - click's, or typer's copy of it
        return _without_flag_types(super().get_params(*context))


class Group(TyperGroup):
    """Group of commands whose help names no type after a flag."""

    def get_params(self, *context: Any) -> list[Any]:  # noqa: D102 - click's, or typer's copy of it
        return _without_flag_types(super().get_params(*context))


class DefaultGroup(Group):
    """Group whose command `show` is taken where none of its commands is named."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:  # noqa: D102 - click's
        if args and args[0] not in self.commands and args[0] not in ctx.help_option_names:
            args = ["show", *args]
        return super().parse_args(ctx, args)

    def shell_complete(self, ctx: Any, incomplete: str) -> list[Any]:  # noqa: D102 - click's
        show = self.commands["show"]
        argument = next(one for one in show.params if one.param_type_name == "argument")
        commands: list[Any] = super().shell_complete(ctx, incomplete)
        return commands + list(argument.shell_complete(ctx, incomplete))


def _without_flag_types(parameters: list[Any]) -> list[Any]:
    for parameter in parameters:
        if isinstance(parameter, TyperOption) and parameter.is_flag and parameter.metavar is None:
            parameter.metavar = ""
    return parameters


def command(
    group: typer.Typer, request: Callable[..., Request], name: str | None = None
) -> Callable[[Callable[[Request], None]], Callable[[Request], None]]:
    """Decorate a function of a record as a command of a group.

    Args:
        group: receives the command.
        request: dataclass whose fields are annotated as typer's arguments and options.
        name: of the command; by default the function's.
    """

    def decorate(run: Callable[[Request], None]) -> Callable[[Request], None]:
        def callback(**values: object) -> None:
            run(request(**values))

        signature = inspect.signature(request)
        for parameter in signature.parameters.values():
            for info in get_args(parameter.annotation)[1:]:
                info.readable = False  # who reads a file says in one line why that fails
        setattr(callback, "__signature__", signature)  # noqa: B010
        group.command(name or run.__name__, cls=Command, help=inspect.getdoc(run))(callback)
        return run

    return decorate
