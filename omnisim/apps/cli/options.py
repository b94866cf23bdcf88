"""Options of commands, generated from the fields of their requests.

A request is a frozen dataclass. The string below a field is the option's help. Its flag and the
placeholder of its value follow from name and type: `size_px: int` becomes `--size PX`, `rays: Path`
becomes `--rays FILE`, `force: bool` becomes `--force`. `Option` and `Argument`, in `Annotated`,
override details. A field whose type is a dataclass is a group of options; the class's `panel` is
its heading on the help page.
"""

from __future__ import annotations

import dataclasses
import inspect
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, TypeVar, get_args, get_origin, get_type_hints

import typer

from omnisim.core.files.attribute_docs import attribute_docs

T = TypeVar("T")
_UNITS = {  # by the suffix of a field's name
    "px": "PX", "m": "M", "deg": "DEG", "degps": "DEG/S", "mps": "M/S", "s": "S", "hz": "HZ",
}  # fmt: skip
_TYPES = {Path: "FILE", int: "N"}


@dataclass(frozen=True, kw_only=True)
class Option:
    """Details of an option that do not follow from its field's name and type.

    Attributes:
        flags: flags on the command line; empty: `--name`, and `-o` for the field `output`.
        metavar: placeholder of the value on the help page; empty: by unit or type.
        default: text for the default on the help page if the default is None.
        names: values to complete; the help text may list them as `{names}`.
        complete: completion of values that depend on other arguments, in typer's signature.
        min, max: limits of a number.
        parse: reader of the text of a value; None: by the field's type.
    """

    flags: tuple[str, ...] = ()
    metavar: str = ""
    default: str = ""
    names: Callable[[], Iterable[str]] | None = None
    complete: Callable[..., list[str]] | None = None
    min: float | None = None
    max: float | None = None
    parse: Callable[[str], object] | None = None


@dataclass(frozen=True, kw_only=True)
class Argument(Option):
    """Details of a positional argument."""


def parameters(request: type) -> dict[str, inspect.Parameter]:
    """Typer parameters of a request and its groups, by field name."""
    made: dict[str, inspect.Parameter] = {}
    hints, docs = get_type_hints(request, include_extras=True), attribute_docs(request)
    for field in dataclasses.fields(request):
        hint = hints[field.name]
        if dataclasses.is_dataclass(hint):
            assert isinstance(hint, type)
            made |= parameters(hint)
            continue
        is_detailed = get_origin(hint) is Annotated
        kind, details = get_args(hint)[:2] if is_detailed else (hint, Option())
        info = _info(field.name, kind, details, docs[field.name], getattr(request, "panel", None))
        required = field.default is dataclasses.MISSING
        made[field.name] = inspect.Parameter(
            field.name,
            inspect.Parameter.KEYWORD_ONLY,
            default=inspect.Parameter.empty if required else field.default,
            annotation=Annotated[kind, info],
        )
    return made


def make_request(request: type[T], values: Mapping[str, object]) -> T:
    """Build a request and its groups from the values of `parameters`."""
    hints = get_type_hints(request)
    return request(
        **{
            field.name: make_request(hints[field.name], values)
            if dataclasses.is_dataclass(hints[field.name])
            else values[field.name]
            for field in dataclasses.fields(request)  # type: ignore[arg-type]  # a dataclass
        }
    )


def flag_of(request: type, name: str) -> str:
    """Flag of an option for messages: its last one."""
    hint = get_type_hints(request, include_extras=True)[name]
    details = get_args(hint)[1] if get_origin(hint) is Annotated else Option()
    return _flags(name, details)[-1].partition("/")[0]


def _info(name: str, kind: Any, details: Option, text: str, panel: str | None) -> Any:
    """Typer's description of an option or an argument."""
    names, complete = details.names, details.complete
    if names is not None:
        complete = complete or completion_of(names)
        text = text.replace("{names}", " ".join(names()) if "{names}" in text else "")
    common: dict[str, Any] = {
        "help": text,
        "metavar": details.metavar or _metavar(name, kind),
        "autocompletion": complete,
        "show_default": details.default or True,
        "rich_help_panel": panel,
        "min": details.min,
        "max": details.max,
        "parser": details.parse,
        "readable": False,  # the reader of a file reports its own errors
    }
    if not isinstance(details, Argument):
        return typer.Option(*_flags(name, details), **common)
    return typer.Argument(**common | {"show_default": details.default or False})


def _flags(name: str, details: Option) -> tuple[str, ...]:
    stem, _, unit = name.rpartition("_")
    flag = "--" + (stem if unit in _UNITS else name).replace("_", "-")
    return details.flags or (("-o", flag) if name == "output" else (flag,))


def _metavar(name: str, kind: Any) -> str | None:
    """Placeholder of a value; None: typer's own, which lists an enumeration's members."""
    unit = _UNITS.get(name.rpartition("_")[2])
    kinds = [one for one in get_args(kind) or (kind,) if one is not type(None)]
    return "" if kinds == [bool] else unit or _TYPES.get(kinds[0])


def completion_of(names: Callable[[], Iterable[str]]) -> Callable[[str], list[str]]:
    """Completion from a list of names, which is evaluated at each key press."""

    def complete(incomplete: str) -> list[str]:
        return [name for name in names() if name.startswith(incomplete)]

    return complete
