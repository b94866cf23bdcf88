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
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import Annotated, Any, NamedTuple, TypeVar, get_args, get_origin, get_type_hints

import typer

from omnisim.core.files.attribute_docs import attribute_docs

T = TypeVar("T")
UNITS = {  # placeholder, noun and example of a number, by the suffix of its field's name
    "px": ("PX", "pixels", "360"), "m": ("M", "meters", "1.5"), "deg": ("DEG", "degrees", "90"),
    "degps": ("DEG/S", "degrees per second", "30"), "mps": ("M/S", "meters per second", "0.5"),
    "s": ("S", "seconds", "2.5"), "hz": ("HZ", "hertz", "10"),
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
        example: value for messages; empty: by default, unit and placeholder.
    """

    flags: tuple[str, ...] = ()
    metavar: str = ""
    default: str = ""
    names: Callable[[], Iterable[str]] | None = None
    complete: Callable[..., list[str]] | None = None
    min: float | None = None
    max: float | None = None
    parse: Callable[[str], object] | None = None
    example: str = ""


@dataclass(frozen=True, kw_only=True)
class Argument(Option):
    """Details of a positional argument."""


class RequestField(NamedTuple):
    """Option or argument of a request.

    Attributes:
        name: name of the field.
        kind: type of its value, without `Annotated`.
        details: its details.
        text: help.
        default: default value; `dataclasses.MISSING`: required.
        panel: heading on the help page.
    """

    name: str
    kind: Any
    details: Option
    text: str
    default: Any
    panel: str | None

    @property
    def flags(self) -> tuple[str, ...]:
        """Flags on the command line."""
        return _flags(self.name, self.details)

    @property
    def metavar(self) -> str | None:
        """Placeholder of the value; None: typer's own, which lists an enumeration's members."""
        unit = UNITS.get(self.name.rpartition("_")[2], ("",))[0]
        kind = "" if self.kinds == [bool] else unit or _TYPES.get(self.kinds[0])
        return self.details.metavar or kind

    @property
    def label(self) -> str:
        """Last flag of an option, placeholder of an argument, for messages."""
        if isinstance(self.details, Argument):
            return (self.metavar or self.name).strip("[]")
        return self.flags[-1].partition("/")[0]

    @property
    def kinds(self) -> list[Any]:
        """Types of the words of a value: three for X Y Z; that of the items of a list."""
        kind = next((one for one in get_args(self.kind) if one is not type(None)), self.kind)
        if get_origin(self.kind) in (list, tuple):
            kind = self.kind
        return list(get_args(kind)) or [kind]

    @property
    def choices(self) -> list[str]:
        """All valid values, if it is one of a few names; else empty."""
        kind = self.kinds[0]
        if isinstance(kind, type) and issubclass(kind, Enum):
            return [member.value for member in kind]
        names = list(self.details.names()) if self.details.names and self.details.metavar else []
        return names if "|".join(names) == self.details.metavar else []


def request_fields(request: type) -> Iterator[RequestField]:
    """Fields of a request and of its groups."""
    hints, docs = get_type_hints(request, include_extras=True), attribute_docs(request)
    for field in dataclasses.fields(request):
        hint = hints[field.name]
        if dataclasses.is_dataclass(hint):
            assert isinstance(hint, type)
            yield from request_fields(hint)
            continue
        is_detailed = get_origin(hint) is Annotated
        kind, details = get_args(hint)[:2] if is_detailed else (hint, Option())
        text, panel = docs[field.name], getattr(request, "panel", None)
        if details.names and "{names}" in text:
            text = text.replace("{names}", " ".join(details.names()))
        yield RequestField(field.name, kind, details, text, field.default, panel)


def parameters(request: type) -> dict[str, inspect.Parameter]:
    """Typer parameters of a request and its groups, by field name."""
    return {
        field.name: inspect.Parameter(
            field.name,
            inspect.Parameter.KEYWORD_ONLY,
            default=inspect.Parameter.empty
            if field.default is dataclasses.MISSING
            else field.default,
            annotation=Annotated[field.kind, _info(field)],
        )
        for field in request_fields(request)
    }


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


def _info(field: RequestField) -> Any:
    """Typer's description of an option or an argument."""
    details = field.details
    complete = details.complete or (completion_of(details.names) if details.names else None)
    common: dict[str, Any] = {
        "help": field.text,
        "metavar": field.metavar,
        "autocompletion": complete,
        "show_default": details.default or True,
        "rich_help_panel": field.panel,
        "min": details.min,
        "max": details.max,
        "parser": details.parse,
        "readable": False,  # the reader of a file reports its own errors
    }
    if not isinstance(details, Argument):
        return typer.Option(*field.flags, **common)
    return typer.Argument(**common | {"show_default": details.default or False})


def _flags(name: str, details: Option) -> tuple[str, ...]:
    stem, _, unit = name.rpartition("_")
    flag = "--" + (stem if unit in UNITS else name).replace("_", "-")
    return details.flags or (("-o", flag) if name == "output" else (flag,))


def completion_of(names: Callable[[], Iterable[str]]) -> Callable[[str], list[str]]:
    """Completion from a list of names, which is evaluated at each key press."""

    def complete(incomplete: str) -> list[str]:
        return [name for name in names() if name.startswith(incomplete)]

    return complete
