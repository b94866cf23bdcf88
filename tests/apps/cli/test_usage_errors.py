"""Command lines that cannot be parsed: one line each, in omnisim's own words, status 2."""

import re
import shlex
import tomllib
from dataclasses import MISSING
from pathlib import Path

import pytest

from omnisim.apps.cli.app import app
from omnisim.apps.cli.command import Command
from omnisim.apps.cli.options import Argument, request_fields
from omnisim.apps.cli.usage_errors import CommandLine, CommandLineError, example_of

TABLE = tomllib.loads(Path(__file__).with_name("messages.toml").read_text(encoding="utf-8"))
OF_LIBRARIES = re.compile(
    r"usage:|invalid value|input should|\bstring\b|parse|integer|pydantic|click|typer|argument\(s\)"
    r"|\btuple\b|no such option:|requires|[╭│╰]",
    re.IGNORECASE,
)


def _commands():
    import typer.main

    groups = [typer.main.get_command(app)]
    while groups:
        for command in groups.pop().commands.values():
            if isinstance(command, Command):
                yield command
            else:
                groups.append(command)


def _options():
    """Pairs of a command and an option or argument of it that takes a value."""
    for command in _commands():
        for field in request_fields(command._request) if command._request else ():
            if field.kinds != [bool]:
                yield command, field


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


def test_there_are_200_bad_commands():
    assert sum(map(len, TABLE["messages"].values())) + len(TABLE["usage"]) >= 200


def test_examples_are_right_values():
    """A command line of the examples in messages is accepted."""
    for command, field in _options():
        words = []
        for other in request_fields(command._request):
            if other.default is MISSING or other.name == field.name:
                example = example_of(other).split()
                assert example, (command._path, other.name)
                is_argument = isinstance(other.details, Argument)
                words += example if is_argument else [other.flags[-1], *example]
        _parse(command, *words)


def test_each_option_names_itself_without_its_value():
    for command, field in _options():
        if isinstance(field.details, Argument):
            continue
        flag = field.flags[-1]
        assert _fails(command, flag).startswith(f"{flag}: expected ")
        assert _fails(command, flag, flag).endswith(", got nothing")


def test_each_number_rejects_a_word():
    for command, field in _options():
        if field.kinds[0] not in (int, float) or isinstance(field.details, Argument):
            continue
        if field.details.parse is None:
            flag = field.flags[-1]
            line = _fails(command, flag, *["7 apples"] * len(field.kinds))
            assert line.startswith(f"{flag}: expected ")
            assert "7 apples" in line


def test_each_choice_suggests_the_nearest():
    for command, field in _options():
        for choice in field.choices if not isinstance(field.details, Argument) else ():
            flag = field.flags[-1]
            line = CommandLine(command._path, command._request, [flag, f"{choice}x"])
            with pytest.raises(CommandLineError, match=f"{flag}: expected one of .*{choice}"):
                line.check_values({field.name: f"{choice}x"}, [])


def test_each_command_rejects_unknown_options_and_words():
    for command in _commands():
        line = _fails(command, "--no-such-option")
        assert line == (
            f"--no-such-option: omnisim {command._path} has no such option; "
            f"see omnisim {command._path} --help"
        )
