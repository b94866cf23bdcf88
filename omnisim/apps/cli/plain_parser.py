"""Parses plain command lines without typer, whose import and types cost more than a small image.

Only what needs no explanation is parsed here: known commands, full option names and valid values.
Typer parses everything else, and explains what is wrong with it. Both read the same requests.
"""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Mapping, Sequence
from enum import Enum
from pathlib import Path
from types import NoneType
from typing import Annotated, Any, NamedTuple, get_args, get_origin, get_type_hints

from omnisim.apps.cli.entries import Entry, GroupEntry
from omnisim.apps.cli.options import Argument, Option, flags_of, make_request

_INTEGER = re.compile(r"-?[0-9]+", re.ASCII)
_NUMBER = re.compile(r"-?([0-9]+(\.[0-9]*)?|\.[0-9]+)([eE][-+]?[0-9]{1,3})?", re.ASCII)


class ParsedCommand(NamedTuple):
    """Command of a plain command line.

    Attributes:
        path: name of the command, preceded by its group's.
        entry: entry of the table.
        request: instance of its request; None: it has none.
    """

    path: str
    entry: Entry
    request: object | None


class _NotPlain(Exception):
    """The command line is left to typer."""


class _Parameter(NamedTuple):
    """Option or argument of a command.

    Attributes:
        name: name of its field.
        kind: type of one value.
        values: number of values of one occurrence; 0: a flag.
        repeats: each occurrence adds a value to a list.
        option: details.
    """

    name: str
    kind: Any
    values: int
    repeats: bool
    option: Option


def parse(
    arguments: Sequence[str], table: Mapping[str, Mapping[str, Entry | GroupEntry]]
) -> ParsedCommand | None:
    """Parse a command line; None: it is not plain.

    Args:
        arguments: command line without the program's name.
        table: entries by name, grouped by heading of the help page.
    """
    commands: Mapping[str, Entry | GroupEntry] = {
        name: entry for entries in table.values() for name, entry in entries.items()
    }
    words = list(arguments)
    path = []
    while words and words[0] in commands:
        path.append(words.pop(0))
        entry = commands[path[-1]]
        if isinstance(entry, Entry):
            try:
                return ParsedCommand(" ".join(path), entry, _request(entry, words))
            except _NotPlain:
                return None
        commands = entry.commands
    return None


def _request(entry: Entry, words: list[str]) -> object | None:
    """Request of a command from the words after its name."""
    request = entry.request_class
    if request is None:
        if words:
            raise _NotPlain
        return None
    values: dict[str, object] = {}
    flags: dict[str, tuple[_Parameter, bool]] = {}  # with the value of a flag
    positional: list[_Parameter] = []
    for one, default in _parameters(request):
        if default is not dataclasses.MISSING:
            values[one.name] = default
        if isinstance(one.option, Argument):
            positional.append(one)
            continue
        for flag in flags_of(one.name, one.option):
            yes, _, no = flag.partition("/")
            flags[yes] = one, True
            if no:
                flags[no] = one, False
    given: dict[str, list[object]] = {}
    while words:
        word = words.pop(0)
        if not word.startswith("-"):
            if not positional or positional[0].values != 1 or positional[0].repeats:
                raise _NotPlain
            argument = positional.pop(0)
            values[argument.name] = _value(word, argument)
            continue
        flag, equals, text = word.partition("=") if word.startswith("--") else (word, "", "")
        if flag not in flags:
            raise _NotPlain
        parameter, is_set = flags[flag]
        if equals:
            words.insert(0, text)
        if parameter.values == 0:
            if equals:
                raise _NotPlain
            values[parameter.name] = is_set
            continue
        if len(words) < parameter.values:
            raise _NotPlain
        read = [_value(words.pop(0), parameter) for _ in range(parameter.values)]
        if parameter.repeats:
            given.setdefault(parameter.name, []).extend(read)
        else:
            values[parameter.name] = read[0] if parameter.values == 1 else tuple(read)
    values |= given
    if any(one.name not in values for one, _ in _parameters(request)):
        raise _NotPlain
    return make_request(request, values)


def _parameters(request: type) -> list[tuple[_Parameter, object]]:
    """Parameters of a request and its groups, with their defaults; later fields replace earlier."""
    made: dict[str, tuple[_Parameter, object]] = {}
    hints = get_type_hints(request, include_extras=True)
    for field in dataclasses.fields(request):
        hint = hints[field.name]
        if dataclasses.is_dataclass(hint):
            assert isinstance(hint, type)
            made |= {one.name: (one, default) for one, default in _parameters(hint)}
            continue
        is_detailed = get_origin(hint) is Annotated
        kind, details = get_args(hint)[:2] if is_detailed else (hint, Option())
        made[field.name] = _parameter(field.name, kind, details), field.default
    return list(made.values())


def _parameter(name: str, kind: Any, details: Option) -> _Parameter:
    kinds = [one for one in get_args(kind) if one is not NoneType]
    if NoneType in get_args(kind) and len(kinds) == 1:
        (kind,) = kinds
    origin, parts = get_origin(kind), get_args(kind)
    if kind is bool:
        return _Parameter(name, bool, 0, False, details)
    if origin is tuple and len(set(parts)) == 1:
        return _Parameter(name, parts[0], len(parts), False, details)
    if origin is list:
        return _Parameter(name, parts[0], 1, True, details)
    return _Parameter(name, kind, 1, False, details)


def _value(text: str, parameter: _Parameter) -> object:
    """Value of a word."""
    kind, option = parameter.kind, parameter.option
    if not text:
        raise _NotPlain
    if kind in (int, float):
        if (_INTEGER if kind is int else _NUMBER).fullmatch(text) is None:
            raise _NotPlain
        number: float = kind(text)
        is_low = option.min is not None and number < option.min
        if is_low or (option.max is not None and number > option.max):
            raise _NotPlain
        return number
    if text.startswith("-"):  # a forgotten value, most often
        raise _NotPlain
    if kind in (str, Path):
        return kind(text)
    if isinstance(kind, type) and issubclass(kind, Enum):
        for member in kind:
            if member.value == text:
                return member
    raise _NotPlain
