"""Command lines that cannot be parsed: one line each, in omnisim's own words, status 2."""

import math
import re
import shlex
import tomllib
from pathlib import Path

import pytest

from omnisim.apps.cli.app import COMMANDS, command_named
from omnisim.apps.cli.command import Command
from omnisim.apps.cli.options import ENTRIES, CommandLineError
from omnisim.rendering.twist import MAX_MPS, MAX_RADPS

TABLE = tomllib.loads(Path(__file__).with_name("messages.toml").read_text(encoding="utf-8"))
OF_LIBRARIES = re.compile(
    r"usage:|invalid value|input should|\bstring\b|parse|integer|pydantic|click|typer|argument\(s\)"
    r"|\btuple\b|no such option:|requires|[╭│╰]",
    re.IGNORECASE,
)


for _name in (name for modules in COMMANDS.values() for name in modules):
    command_named(_name)  # imports its request


def _options():
    """Pairs of a command and an option or argument of it that takes a value."""
    for entry in ENTRIES.values():
        for field in entry.fields:
            if not field.is_flag:
                yield Command(entry), field


def _parse(command, *words):
    command.make_context(command.name, list(words))


def _fails(command, *words):
    with pytest.raises(CommandLineError) as caught:
        _parse(command, *words)
    line = str(caught.value)
    assert "\n" not in line
    assert not OF_LIBRARIES.search(line.partition(" ")[2]), line
    return line


def test_bad_command_lines_are_one_line_and_no_file(omnisim, tmp_path):
    for command, expected in TABLE["usage"].items():
        status, out, error = omnisim(*shlex.split(command))
        assert (command, status, out, error) == (command, 2, "", f"error: {expected}\n")
        assert not OF_LIBRARIES.search(expected), command
    assert list(tmp_path.iterdir()) == []


def test_examples_are_right_values():
    """A command line of the examples in messages is accepted."""
    for command, field in _options():
        words = []
        for other in command.entry.fields:
            if other.is_required or other.name == field.name:
                example = other.example.split()
                assert example, (command.entry.path, other.name)
                words += example if other.is_argument else [other.flags[-1], *example]
        _parse(command, *words)


def test_each_option_names_itself_without_its_value():
    for command, field in _options():
        if field.is_argument:
            continue
        flag = field.flags[-1]
        assert _fails(command, flag).startswith(f"{flag}: expected ")
        assert _fails(command, flag, flag).endswith(", got nothing")


def test_each_number_rejects_a_word():
    for command, field in _options():
        if field.kinds[0] not in (int, float) or field.is_argument or field.details.parse:
            continue
        flag = field.flags[-1]
        line = _fails(command, flag, *["7 apples"] * len(field.kinds))
        assert line.startswith(f"{flag}: expected ")
        assert "7 apples" in line


def test_each_number_rejects_what_is_beyond_its_limits():
    for command, field in _options():
        for key, limit in field.limits.items():
            beyond = limit + (-1 if key[0] == "g" else 1) * max(1, abs(limit))
            for number in (f"{beyond:g}" if float in field.kinds else f"{int(beyond)}", "nan"):
                line = _fails(command, field.flags[-1], number)
                assert line.startswith(f"{field.flags[-1]}: expected a")
                assert line.endswith(f", got {number}")


def test_each_choice_suggests_the_nearest():
    for command, field in _options():
        for choice in field.choices:
            flag = [] if field.is_argument else [field.flags[-1]]
            line = _fails(command, *flag, f"{choice}x")
            assert line.startswith(f"{field.label}: expected one of ")
            assert choice in line


def test_each_command_rejects_unknown_options_and_words():
    for entry in ENTRIES.values():
        line = _fails(Command(entry), "--no-such-option")
        assert line == (
            f"--no-such-option: omnisim {entry.path} has no such option; "
            f"see omnisim {entry.path} --help"
        )


def test_speeds_have_the_limits_of_a_twist():
    limits = {field.name: field.limits["le"] for field in ENTRIES["render"].fields if field.limits}
    assert limits["speed_mps"] == MAX_MPS
    assert limits["turn_rate_degps"] == math.floor(math.degrees(MAX_RADPS))
