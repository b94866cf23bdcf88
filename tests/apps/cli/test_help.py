"""Help of all commands, as a person reads it."""

import re
import shlex
from typing import Annotated

import pytest

from omnisim.apps.cli.app import COMMANDS, GROUPS, app, command_named
from omnisim.apps.cli.options import ENTRIES, OWN, of, options, request_fields
from omnisim.core.files.file_keys import keys_of
from omnisim.core.files.parameters import table_of
from omnisim.core.trajectories.odometry import OdometryErrors

for _name in (name for modules in COMMANDS.values() for name in modules):
    command_named(_name)  # imports its request
FIELDS = {path: entry.fields for path, entry in ENTRIES.items()}
SHORT = 14  # options, so that all are shown


def test_the_commands_are_those_of_the_table():
    names = [name for modules in COMMANDS.values() for name in modules]
    assert {path.partition(" ")[0] for path in ENTRIES} == set(names)
    assert {path.partition(" ")[0] for path in ENTRIES if " " in path} == set(GROUPS)


@pytest.mark.parametrize("path", ENTRIES)
def test_help_has_examples_and_what_matters_first_and_all_on_request(omnisim, path):
    entry = ENTRIES[path]
    assert len(entry.examples) == (2 if entry.fields else 1)
    text, everything = (omnisim(*path.split(), flag)[1] for flag in ("--help", "--help-all"))
    lines = text.splitlines()
    start = lines.index("") + 1
    assert [line.strip() for line in lines[start:]][: len(entry.examples)] == entry.examples
    for example in entry.examples:
        words = shlex.split(example.partition(" > ")[0])[1:]
        name = words.pop(0)
        parsed = command_named(name)
        if name in GROUPS:
            child = words[0] if words[0] in parsed.commands else "show"
            words = words[1:] if words[0] == child else words
            assert f"{name} {child}" == path
            parsed = parsed.commands[child]
        parsed.make_context(name, words)
    fields = [field for field in entry.fields if not field.is_argument]
    assert set(entry.first) <= {field.name for field in fields}
    assert len(entry.first) in range(8, 13) if len(fields) > SHORT else not entry.first
    assert all(field.name in entry.first for field in fields if entry.first and field.is_required)
    for field in fields:
        assert re.search(rf"{field.flags[-1]}\b", everything)
        is_shown = not entry.first or field.name in entry.first
        row = rf"^  (?:-\w, )?{field.label}(?![\w-])"
        assert is_shown == bool(re.search(row, text, re.MULTILINE))
    assert ("--help-all" in text) == bool(entry.first)


def test_each_help_is_a_sentence_with_its_default_and_what_the_option_takes():
    for path, fields in FIELDS.items():
        assert ENTRIES[path].summary.endswith(".")
        for field in fields:
            fault = f"{path} {field.name}: {field.text}"
            assert bool(field.metavar) != field.is_flag, fault
            assert re.match("[A-Z0-9].*[.]$", field.text, re.DOTALL), fault
            assert "by default" not in field.text, fault
            assert field.text.count("Default: ") <= 1, fault


def test_camera_is_a_file_camera_name_a_name_and_no_option_named_twice():
    for path, fields in FIELDS.items():
        metavars = [(flag, field.metavar) for field in fields for flag in field.flags]
        assert dict(metavars).get("--camera", "FILE") == "FILE", path
        assert dict(metavars).get("--camera-name", "NAME").startswith("NAME"), path
        assert len(dict(metavars)) == len(metavars), path


@pytest.mark.parametrize("columns", [80, 100])
def test_no_word_is_broken_at_a_hyphen(ran, monkeypatch, columns):
    monkeypatch.setenv("COLUMNS", str(columns))
    text, _ = ran("validate", "--help")
    assert "optics-calibration" in text
    assert not re.search(r"\w-\n", text)


def test_groups_without_a_command_show_their_help(ran):
    for name in GROUPS:
        text, _ = ran(name)
        assert all(f"  {child} " in text for child in command_named(name).commands)
    text, _ = ran()
    assert all(f"  {name} " in text for name in app.list_commands(None))


def test_an_option_may_refer_to_the_field_of_a_thing():
    """Its help, its limits and its default are then stated there, and nowhere else."""
    fields = {field.name: field for field in FIELDS["bake"]}
    assert fields["samples"].limits == {"ge": 1, "le": 65536}
    assert fields["texel_m"].limits == {"ge": 1e-4, "le": 100.0}
    assert fields["samples"].text == "Number of rays per texel. Default: 128."
    assert fields["seed"].default == 0


def test_an_option_in_degrees_refers_to_a_field_in_radians():
    @options
    class Group:
        turn_tick_deg: Annotated[float, of("core.trajectories.odometry.OdometryErrors")] = OWN

    (field,) = request_fields(Group)
    (key,) = (key for key in keys_of(table_of(OdometryErrors)) if key.name == "turn_tick_deg")
    assert (field.text, field.default) == (f"{key.help} Default: 0.", key.default)
    assert field.limits == {"ge": key.low.value, "le": key.high.value}
