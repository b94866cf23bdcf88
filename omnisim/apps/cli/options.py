"""Commands and their options, each stated once: as a request and its fields.

    @command("robot check", "runs.robot.check_robot")
    class CheckRequest:
        '''Check a robot file with its body and sensors, and summarize it.

        omnisim robot check p2at
        omnisim robot check my-robot.toml
        '''

        robot: Annotated[str, Argument(metavar="FILE", example="p2at")]
        '''Robot file, folder with a robot.toml, or built-in name.'''

Parser, messages, help pages, completion and the reference are derived from it. The string below a
field is the option's help. Its flag and the placeholder of its value follow from name and type:
`size_px: int` becomes `--size PX`, `rays: Path` becomes `--rays FILE`, `force: bool` becomes
`--force`. `Option` and `Argument`, in `Annotated`, override details, or name the owner of the
setting: `of("runs.route.Route")` takes limits and help of that class's field of the same name. A
field whose type is a dataclass is a group of options, under the class's `panel` on the help page.
"""

from __future__ import annotations

import dataclasses
import operator
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from importlib import import_module
from pathlib import Path
from types import NoneType
from typing import (
    TYPE_CHECKING,
    Annotated,
    Any,
    Literal,
    NamedTuple,
    TypeVar,
    dataclass_transform,
    get_args,
    get_origin,
    get_type_hints,
)  # fmt: skip

from omnisim.core.errors import OmnisimError, OutputError, did_you_mean
from omnisim.core.files.attribute_docs import attribute_docs

if TYPE_CHECKING:
    import click

    from omnisim.core.files.file_keys import Key

T = TypeVar("T")
UNITS = {  # placeholder, noun and example of a number, by the suffix of its field's name
    "px": ("PX", "pixels", "360"), "m": ("M", "meters", "1.5"), "deg": ("DEG", "degrees", "90"),
    "degps": ("DEG/S", "degrees per second", "30"), "mps": ("M/S", "meters per second", "0.5"),
    "s": ("S", "seconds", "2.5"), "hz": ("HZ", "hertz", "10"),
}  # fmt: skip
_TYPES = {Path: "FILE", int: "N"}
_LIMITS = {"ge": " from {:g}", "gt": " above {:g}", "le": " to {:g}", "lt": " below {:g}"}
_EXAMPLES = {  # by the placeholder of a value
    "[SCENE]": "soccer", "ADDRESS": "ray://localhost:10001", "BOARD": "8x6:30mm",
    "CHANNELS": "range,normals", "FILE": "camera.yaml", "FROM:TO": "0:4", "LOW HIGH": "-45 14",
    "MODEL": "kannala_brandt", "N|auto|exact": "auto", "NAME": "front", "POLYGONS": "3600",
    "NAME=SHARE,…": "train=0.8,val=0.2", "NAME|all": "all", "R|G|B": "G", "SCENE": "soccer",
    "W H": "640 480", "WIDTH HEIGHT": "640 480", "WORD": "gopro", "X Y Z": "0 0 1",
    "X Y": "1 2", "body|camera": "body", "body|camera|NAME": "body", "srgb|GAMMA": "srgb",
}  # fmt: skip

# Suffixes of examples, where the help does not state one, by the first words of the help.
_SUFFIXES = {"Calibration": ".yaml", "JSON": ".json", "Optics": ".toml", "Sensor": ".toml"}


class CommandLineError(OmnisimError):
    """A command line has an unknown word, or an option has an impossible value."""

    exit_status = 2


@dataclass(frozen=True, kw_only=True)
class Option:
    """Details of an option that do not follow from its field's name and type."""

    # flags on the command line; empty: `--name`, and `-o` for the field `output`
    flags: tuple[str, ...] = ()
    # placeholder of the value on the help page; empty: by its names, unit or type
    metavar: str = ""
    # values to complete; the help text may list them as `{names}`
    names: Callable[[], Iterable[str]] | None = None
    # completion of values that depend on other words of the command line
    complete: Callable[[click.Context, str], list[str]] | None = None
    # limits of a number
    ge: float | None = None
    le: float | None = None
    # reader of the text of a value; None: by the field's type
    parse: Callable[[str], object] | None = None
    example: str = ""  # value for messages; empty: by default, unit and placeholder
    help: str = ""  # help of a type that several fields share, in place of a string below each
    # class in `omnisim` whose field of the same name has the limits and the help; `yaw_deg` is that
    # of a field `yaw_rad`
    owner: str = ""


@dataclass(frozen=True, kw_only=True)
class Argument(Option):
    """Details of a positional argument."""


OWN: Any = object()  # default of an option with an owner: that of the owner's field


def of(owner: str, **details: Any) -> Option:
    """Details of an option that sets a field of the same name of a class in `omnisim`."""
    return Option(owner=owner, **details)


@dataclass(frozen=True)
class RequestField:
    """Option or argument of a request."""

    name: str
    kind: Any  # type of its value, without `Annotated` and `None`
    details: Option
    help: str  # the string below it; empty: that of its type, or of the owner's field
    stated: Any  # default in the request; `dataclasses.MISSING`: required; `OWN`: the owner's
    panel: str  # heading on the help page

    @property
    def is_argument(self) -> bool:
        """True for a positional argument."""
        return isinstance(self.details, Argument)

    @property
    def is_required(self) -> bool:
        """True without a default."""
        return self.stated is dataclasses.MISSING

    @property
    def is_flag(self) -> bool:
        """True for an option without a value."""
        return self.kinds == [bool]

    @property
    def is_list(self) -> bool:
        """True if it may be given several times."""
        return get_origin(self.kind) is list

    @property
    def flags(self) -> tuple[str, ...]:
        """Flags on the command line."""
        stem, _, unit = self.name.rpartition("_")
        flag = "--" + (stem if unit in UNITS else self.name).replace("_", "-")
        return self.details.flags or (("-o", flag) if self.name == "output" else (flag,))

    @property
    def label(self) -> str:
        """Last flag of an option, placeholder of an argument, for messages."""
        if self.is_argument:
            return self.name.upper() if self.choices else (self.metavar or self.name).strip("[]")
        return self.flags[-1].partition("/")[0]

    @property
    def metavar(self) -> str:
        """Placeholder of the value; empty for a flag."""
        if self.is_flag or self.details.metavar:
            return self.details.metavar
        unit = UNITS.get(self.name.rpartition("_")[2], ("",))[0]
        return "|".join(self.choices) or unit or _TYPES.get(self.kinds[0], "")

    @cached_property
    def kinds(self) -> list[Any]:
        """Types of the words of a value: three for X Y Z; that of the items of a list."""
        is_several = get_origin(self.kind) in (list, tuple)
        return list(get_args(self.kind)) if is_several else [self.kind]

    @property
    def word_count(self) -> int:
        """Number of words of a value."""
        return 0 if self.is_flag else len(self.kinds)

    @property
    def choices(self) -> tuple[str, ...]:
        """All valid values, if it is one of a few names; else empty."""
        kind = self.kinds[0]
        return get_args(kind) if get_origin(kind) is Literal else ()

    @cached_property
    def default(self) -> Any:
        """Default value; `dataclasses.MISSING`: required."""
        if self.stated is not OWN:
            return self.stated
        return _key(self.details.owner, self.name).default

    @cached_property
    def text(self) -> str:
        """Help, with the default."""
        text = self.help or self.details.help or _key(self.details.owner, self.name).help
        names, default = self.details.names, self.default
        if names and "{names}" in text:
            text = text.replace("{names}", " ".join(names()))
        if default is None or default is False or default is dataclasses.MISSING:
            return text  # there is a default of 0
        value = f"{default:g}" if isinstance(default, float) else default
        return f"{text} Default: {self.label if self.is_flag else value}."

    @cached_property
    def limits(self) -> dict[str, float]:
        """Limits of a number: some of ge, gt, le, lt."""
        own = {"ge": self.details.ge, "le": self.details.le}
        limits = {key: limit for key, limit in own.items() if limit is not None}
        if self.details.owner:
            key = _key(self.details.owner, self.name)
            for limit, strict, loose in ((key.low, "gt", "ge"), (key.high, "lt", "le")):
                if limit is not None:
                    limits[strict if limit.is_open else loose] = limit.value
        return limits

    @property
    def example(self) -> str:
        """Valid value, for messages."""
        details, kind, metavar = self.details, self.kinds[0], self.metavar
        if details.example or self.choices:
            return details.example or self.choices[0]
        if metavar in _EXAMPLES and kind is not Path and details.names is None:
            return _EXAMPLES[metavar]
        if kind in (int, float):
            default = self.default if isinstance(self.default, int | float) else None
            limits = self.limits
            low = limits.get("ge", limits.get("gt", -1e9))
            high = limits.get("le", limits.get("lt", 1e9))
            return f"{default or max(low, min(float(self._unit[2]), high)):g}"
        if isinstance(self.default, str) and self.default:
            return self.default
        if kind is Path and metavar == "DIR":
            return "folder"
        stated = re.search(r"\.[a-z]\w+", self.text)
        suffix = stated[0] if stated else _SUFFIXES.get(self.text.partition(" file")[0], "")
        if kind is Path or suffix:
            return f"{self.name.removesuffix('_file')}{suffix}"
        return next(iter(details.names()), "") if details.names else ""

    @property
    def expected(self) -> str:
        """Expected value in words."""
        kind, metavar, count = self.kinds[0], self.metavar, len(self.kinds)
        if kind is Path:
            return "a folder" if metavar == "DIR" else "a file"
        if kind not in (int, float) or self.details.parse:
            return f"one value, {metavar}" if metavar else "one value"
        noun = "whole number" if kind is int else "number"
        if count > 1:
            return f"{count} {noun}s" + (f", {metavar}" if metavar else "")
        unit = f" of {self._unit[1]}" if self._unit[1] else ""
        limits = self.limits
        return f"a {noun}{unit}" + "".join(
            text.format(limits[key]) for key, text in _LIMITS.items() if key in limits
        )

    @property
    def _unit(self) -> tuple[str, str, str]:
        """Placeholder, noun and example of a number's unit."""
        return next((unit for unit in UNITS.values() if unit[0] == self.metavar), ("", "", "1"))

    def read(self, words: str | Sequence[str]) -> object:
        """Value of the words of one occurrence."""
        if isinstance(words, str):
            return self._read(self.kinds[0], words)
        return tuple(map(self._read, self.kinds, words))

    def _read(self, kind: Any, word: str) -> object:
        if self.choices and word not in self.choices:
            raise self.error(word)
        if self.metavar == "FILE" and not self.is_argument and not Path(word).name:
            raise self.error(word)  # a path without a name: empty, . or /
        try:
            value = word if self.choices else (self.details.parse or kind)(word)
        except ValueError:
            raise self.error(word) from None
        compared = (getattr(operator, key)(value, limit) for key, limit in self.limits.items())
        if not all(compared):  # NaN is within no limits
            raise self.error(word)
        return value

    def error(self, value: str, label: str = "") -> CommandLineError:
        """Error for a value that the option cannot have; `label` is its flag as it was given."""
        label = label or self.label
        if self.choices:
            near = did_you_mean(value, self.choices, "")
            hint = f"; {near}" if near.startswith("did") else ""
            expected = f"one of {', '.join(self.choices)}, got {value}{hint}"
        else:
            example = self.example if self.is_argument else f"{label} {self.example}"
            expected = f"{self.expected}, such as {example}, got {value or repr('')}"
        return CommandLineError(f"{label}: expected {expected}")


class CommandEntry(NamedTuple):
    """Command with its request."""

    path: str  # name of the command, preceded by its group's
    # function in `omnisim.apps.cli` that takes the request, imported when the command runs; if it
    # returns False, the exit status is 1
    run: str
    request: type  # the request's class
    first: tuple[str, ...]  # options that its help page shows; empty: all
    extra: str | None  # required extra of the package; None: no extra
    elsewhere: Mapping[str, str]  # where to find options that a user may expect here, by flag

    @property
    def summary(self) -> str:
        """Sentence about the command."""
        return " ".join((self.request.__doc__ or "").partition("\n\n")[0].split())

    @property
    def examples(self) -> list[str]:
        """Command lines."""
        lines = (line.strip() for line in (self.request.__doc__ or "").splitlines()[1:])
        return [line for line in lines if line.startswith("omnisim ")]

    @property
    def fields(self) -> list[RequestField]:
        """Options and arguments."""
        return request_fields(self.request)

    def make(self, values: Mapping[str, object]) -> object:
        """Request with the values of its fields and those of its groups; others are defaults."""
        defaults = {field.name: field.default for field in self.fields if field.name not in values}
        return _make(self.request, {**values, **defaults})


ENTRIES: dict[str, CommandEntry] = {}  # by path, of all requests that have been imported


@dataclass_transform(frozen_default=True, kw_only_default=True)
def options(kind: type[T]) -> type[T]:
    """Make a group of options of a class: a frozen dataclass."""
    return dataclass(frozen=True, kw_only=True)(kind)


@dataclass_transform(frozen_default=True, kw_only_default=True)
def command(
    path: str,
    run: str,
    *,
    first: str = "",
    extra: str | None = None,
    elsewhere: Mapping[str, str] | None = None,
) -> Callable[[type[T]], type[T]]:
    """Make a request of a class, and its command; see `CommandEntry`."""

    def register(kind: type[T]) -> type[T]:
        request = options(kind)
        ENTRIES[path] = CommandEntry(
            path, run, request, tuple(first.split()), extra, elsewhere or {}
        )
        return request

    return register


@cache
def _hints(kind: type) -> dict[str, Any]:
    return get_type_hints(kind, include_extras=True)


@cache
def request_fields(request: type) -> list[RequestField]:
    """Fields of a request and of its groups."""
    fields: list[RequestField] = []
    hints, docs = _hints(request), attribute_docs(request)
    panel = getattr(request, "panel", "Options")
    for field in dataclasses.fields(request):
        hint = hints[field.name]
        if dataclasses.is_dataclass(hint):
            assert isinstance(hint, type)
            fields += request_fields(hint)
            continue
        is_detailed = get_origin(hint) is Annotated
        kind, *details = get_args(hint) if is_detailed else (hint, Option())
        if NoneType in (parts := get_args(kind)):
            kind = next(part for part in parts if part is not NoneType)
        text = docs.get(field.name, "")
        fields.append(RequestField(field.name, kind, details[-1], text, field.default, panel))
    return fields


def _make(request: type, values: Mapping[str, object]) -> Any:
    arguments = {}
    for name, hint in _hints(request).items():
        if name in values:
            arguments[name] = values[name]
        elif dataclasses.is_dataclass(hint):
            assert isinstance(hint, type)
            arguments[name] = _make(hint, values)
    return request(**arguments)


def refuse_given(
    options: object, reason: str, *names: str, error: type[OmnisimError] = OutputError
) -> None:
    """Raise an error for options that would have no effect.

    Args:
        options: group of options, or request.
        reason: reason in the message.
        names: fields to check; by default all.
        error: type of the error.

    Raises:
        OmnisimError: of type `error`; names the first option that is not at its default.
    """
    for name in names or [field.name for field in dataclasses.fields(options)]:  # type: ignore[arg-type]
        if getattr(options, name) != getattr(type(options), name):
            raise error(f"{flag_of(type(options), name)}: {reason}")


def words_of(group: Any, *names: str) -> tuple[str, ...]:
    """Words of a command line that repeats a group's options, without those at their defaults.

    `names` selects fields of the group or request; by default all options, without arguments.
    """
    words: list[str] = []
    kind: type = type(group)
    for field in request_fields(kind):
        if field.is_argument or (names and field.name not in names):
            continue
        value = getattr(group, field.name)
        if field.is_flag and value != field.default:
            words.append(field.flags[-1].split("/")[0 if value else -1])
        elif value != field.default:
            values = value if field.is_list else [value]
            words += [word for each in values for word in (field.label, str(each))]
    return tuple(words)


def flag_of(request: type, name: str) -> str:
    """Flag of an option for messages: its last one."""
    return next(field.label for field in request_fields(request) if field.name == name)


@cache
def _key(owner: str, name: str) -> Key:
    """Help, limits and default of a field of a class in `omnisim`; angles are in degrees."""
    from omnisim.core.files.file_keys import keys_of  # imports pydantic
    from omnisim.core.files.parameters import table_of

    module, _, kind = owner.rpartition(".")
    table = table_of(getattr(import_module(f"omnisim.{module}"), kind))
    return next(key for key in keys_of(table) if key.name == name)
