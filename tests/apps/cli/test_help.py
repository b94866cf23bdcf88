"""Help of all commands, as a person reads it."""

import pytest
import typer
import typer.main

from omnisim.apps.cli.app import app


def _commands(command, *names):
    yield names, command
    for name, child in getattr(command, "commands", {}).items():
        yield from _commands(child, *names, name)


CHOICES = ("backend", "kind", "axes", "mode", "overlay")  # their values stand in place of a metavar
COMMANDS = dict(_commands(typer.main.get_command(app)))


@pytest.mark.parametrize("names", COMMANDS, ids=" ".join)
def test_a_flag_has_no_type_and_every_other_option_says_what_it_takes(omnisim, names):
    _, text, _ = omnisim(*names, "--help")
    assert "<bool>" not in text
    assert "[dim]" not in text
    for parameter in COMMANDS[names].params:
        if parameter.param_type_name == "option" and not parameter.is_flag:
            assert parameter.metavar or parameter.name in CHOICES, parameter.name


@pytest.mark.parametrize("names", COMMANDS, ids=" ".join)
def test_each_help_is_a_sentence_that_leaves_its_default_to_the_default(names):
    command = COMMANDS[names]
    for parameter in command.params:
        help_text = parameter.help or ""
        assert help_text.endswith("."), f"{parameter.name}: {help_text}"
        assert help_text[0].isupper() or help_text[0].isdigit(), f"{parameter.name}: {help_text}"
        assert "by default" not in help_text, f"{parameter.name}: {help_text}"


def test_camera_is_a_file_and_camera_name_a_name_in_every_command():
    for names, command in COMMANDS.items():
        for parameter in command.params:
            if "--camera" in parameter.opts:
                assert parameter.metavar == "FILE", names
            if "--camera-name" in parameter.opts:
                assert parameter.metavar.startswith("NAME"), names
