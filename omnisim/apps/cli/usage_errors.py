"""Errors in command lines: one line with the option, what is expected, an example, the value."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import MISSING
from itertools import takewhile
from pathlib import Path
from typing import Any

import typer

from omnisim.apps.cli.options import UNITS, Argument, RequestField, request_fields
from omnisim.core.errors import OmnisimError, did_you_mean

UsageError: Any = typer.BadParameter.__mro__[1]  # click's, or typer's copy of it
_HELP = ("-h", "--help")
_EXAMPLES = {  # by the placeholder of a value
    "[SCENE]": "soccer", "ADDRESS": "ray://localhost:10001", "BOARD": "8x6:30mm",
    "CHANNELS": "range,normals", "FILE": "camera.yaml", "FROM:TO": "0:4", "LOW HIGH": "-45 14",
    "MODEL": "kannala_brandt", "N|auto|exact": "auto", "NAME": "front", "POLYGONS": "3600",
    "NAME=SHARE,…": "train=0.8,val=0.2", "NAME|all": "all", "R|G|B": "G", "SCENE": "soccer",
    "W H": "640 480", "WIDTH HEIGHT": "640 480", "X Y Z": "0 0 1", "body|camera": "body",
    "body|camera|NAME": "body", "srgb|GAMMA": "srgb",
}  # fmt: skip


class CommandLineError(OmnisimError):
    """A command line has an unknown word, or an option has an impossible value."""

    exit_status = 2


class CommandLine:
    """Words after a command's name, with the options that the command has.

    Args:
        path: the command with its groups, such as omnisim robot check.
        request: class that defines the options; None: no options.
        words: words after the name.
    """

    def __init__(self, path: str, request: type | None, words: Sequence[str]):
        self._path = path
        self._fields = [] if request is None else list(request_fields(request))
        self._words = list(words[: words.index("--")] if "--" in words else words)
        self._by_flag = {
            flag: field
            for field in self._fields
            if not isinstance(field.details, Argument)
            for flags in field.flags
            for flag in flags.split("/")
        }

    def check_words(self) -> None:
        """Reject an option without its value, which would take the next option for one.

        Raises:
            CommandLineError: names the option.
        """
        for _, flag, field, values in self._given():
            if len(values) < _word_count(field):
                raise _value_error(field, flag, " ".join(values) or "nothing")

    def check_values(self, values: Mapping[str, Any], rest: Sequence[str]) -> None:
        """Reject a name that is not among an option's, and words that no option takes.

        Args:
            values: values by name of their field.
            rest: words that are left.

        Raises:
            CommandLineError: names the option, or the word.
        """
        for field in self._fields:
            value, choices = values.get(field.name), field.choices
            if isinstance(value, str) and choices and value not in choices:
                raise _value_error(field, field.label, value)
            is_file = field.metavar == "FILE" and not _is_argument(field)
            if is_file and isinstance(value, Path) and not value.name:  # nothing, . or /
                raise _value_error(field, field.label, "" if "" in self._words else str(value))
        for at, flag, field, taken in self._given() if rest else ():
            words = self._words[at + 1 : at + 2 + len(taken)]
            if taken and words[len(taken) :] == [rest[0]]:
                raise _excess_error(field, flag, words)
        if rest:
            names = [one.metavar or one.name for one in self._fields if _is_argument(one)]
            takes = " ".join(names) or "nothing"
            raise CommandLineError(
                f"{rest[0]}: a word too many: {self._path} takes {takes} beside its options"
            )

    def error(self, error: Any) -> CommandLineError:
        """Error to raise in place of an error of the parser."""
        option, name = (getattr(error, key, "") for key in ("option_name", "param"))
        if option in self._by_flag:
            attached = next((word for word in self._words if word.startswith(f"{option}=")), option)
            value = attached.partition("=")[2]
            return CommandLineError(f"{option}: expected no value, got {value!r}")
        if option:
            word = next((word for word in self._words if word.startswith(option)), option)
            return unknown(word, "option", self._path, (*self._by_flag, *_HELP))
        field = next((one for one in self._fields if one.name == getattr(name, "name", "")), None)
        if field is None:
            return CommandLineError(f"{self._path}: {error.format_message()}")
        if type(error).__name__ == "MissingParameter":
            text = " ".join(re.split(r"\.\s|;|\.$", field.text, maxsplit=1)[0].split())
            example = [field.label, example_of(field)]
            if _is_argument(field):
                needed = (one for one in self._fields if one.default is MISSING)
                example = [self._path, *(example_of(one) for one in needed if _is_argument(one))]
            return CommandLineError(f"{field.label}: missing: {text}, such as {' '.join(example)}")
        faults: list[Any] = getattr(error.__cause__, "errors", list)()
        value = faults[0]["input"] if faults else error.message
        words = value if isinstance(value, list | tuple) else [value]
        return _value_error(field, field.label, " ".join(map(str, words)))

    def _given(self) -> Iterator[tuple[int, str, RequestField, list[str]]]:
        """Places of flags, flags, their fields, and the words of their values."""
        for at, word in enumerate(self._words):
            if (field := self._by_flag.get(word)) is not None:
                values = self._words[at + 1 : at + 1 + _word_count(field)]
                yield at, word, field, list(takewhile(lambda one: one not in self._by_flag, values))


def _value_error(field: RequestField, label: str, value: str) -> CommandLineError:
    """Error for a value that an option cannot have; `label` is its flag as it is given."""
    if choices := field.choices:
        near = did_you_mean(value, choices, "")
        hint = f"; {near}" if near.startswith("did") else ""
        return CommandLineError(f"{label}: expected one of {', '.join(choices)}, got {value}{hint}")
    example = example_of(field) if _is_argument(field) else f"{label} {example_of(field)}"
    return CommandLineError(
        f"{label}: expected {_expected(field)}, such as {example}, got {value or repr('')}"
    )


def _excess_error(field: RequestField, flag: str, values: Sequence[str]) -> CommandLineError:
    """Error for an option with more words than it takes."""
    if "comma-separated" in " ".join(field.text.split()):
        example = f"{flag} {','.join(values)}"
    elif "list" in str(field.kind):
        example = " ".join(f"{flag} {value}" for value in values)
    else:
        return _value_error(field, flag, " ".join(values))
    return CommandLineError(f"{flag}: expected {example}, got {flag} {' '.join(values)}")


def unknown(word: str, noun: str, path: str, known: Iterable[str]) -> CommandLineError:
    """Error for an unknown command or option, with the nearest known one.

    Args:
        word: unknown word.
        noun: command or option.
        path: command that was given it.
        known: valid words.
    """
    name = word.partition("=")[0]
    by_letters = {one.lstrip("-"): one for one in known}  # -size is --size, too
    near = did_you_mean(name.lstrip("-"), by_letters, "")
    hint = f"see {path} --help"
    if near.startswith("did"):
        hint = re.sub("'(.+?)'", lambda found: repr(by_letters[found[1]]), near)
    return CommandLineError(f"{name}: {path} has no such {noun}; {hint}")


def example_of(field: RequestField) -> str:
    """Right value of an option or argument, for messages."""
    details, kind, metavar = field.details, field.kinds[0], field.metavar or ""
    if details.example or field.choices:
        return details.example or field.choices[0]
    if metavar in _EXAMPLES and kind is not Path and details.names is None:
        return _EXAMPLES[metavar]
    if kind in (int, float):
        default = field.default if isinstance(field.default, int | float) else None
        example = f"{default:g}" if default else _unit(field)[2]
        within = max(details.min or -1e9, min(float(example), details.max or 1e9))
        return f"{within:g}"
    if isinstance(field.default, str) and field.default:
        return field.default
    suffix = re.search(r"\.[a-z]\w+", field.text)
    if kind is Path and metavar == "DIR":
        return "folder"
    if kind is Path or suffix:
        return f"{field.name.removesuffix('_file')}{suffix[0] if suffix else ''}"
    return next(iter(details.names()), "") if details.names else ""


def _expected(field: RequestField) -> str:
    """Expected value in words."""
    kind, count, details = field.kinds[0], _word_count(field), field.details
    if kind is Path:
        return "a folder" if field.metavar == "DIR" else "a file"
    if kind not in (int, float) or details.parse:
        return f"one value, {field.metavar}" if field.metavar else "one value"
    if count > 1:
        noun = "whole numbers" if kind is int else "numbers"
        return f"{count} {noun}, {field.metavar}" if field.metavar else f"{count} {noun}"
    noun = "a whole number" if kind is int else "a number"
    low, high = details.min, details.max
    limits = "" if low is None else f" from {low:g}"
    limits += "" if high is None else f" to {high:g}"
    unit = _unit(field)[1]
    return noun + (f" of {unit}" if unit else "") + limits


def _unit(field: RequestField) -> tuple[str, str, str]:
    """Placeholder, noun and example of a number's unit."""
    return next((unit for unit in UNITS.values() if unit[0] == field.metavar), ("", "", "1"))


def _is_argument(field: RequestField) -> bool:
    return isinstance(field.details, Argument)


def _word_count(field: RequestField) -> int:
    return 0 if field.kinds == [bool] else len(field.kinds)
