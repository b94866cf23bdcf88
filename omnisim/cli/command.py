"""Commands whose parameters are the fields of a record."""

import inspect
from collections.abc import Callable
from typing import TypeVar

import typer

Request = TypeVar("Request")


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

        setattr(callback, "__signature__", inspect.signature(request))  # noqa: B010
        group.command(name or run.__name__, help=inspect.getdoc(run))(callback)
        return run

    return decorate
