"""Command-line reference from the program's own help."""

from __future__ import annotations

import re
from collections.abc import Iterator

import typer
import typer.main

from omnisim.apps.cli.app import app
from omnisim.apps.cli.commands import COMMANDS

_WIDTH = 80  # of the usage, whatever the terminal's

_HEADER = """# Command line

Every command ends with status 0, or with one line that says what was wrong and status 1; a wrong
option ends with status 2. `omnisim COMMAND --help` prints the same.
"""


def command_line_page() -> str:
    """Markdown of all commands, those of groups included."""
    commands = typer.main.get_command(app).commands
    sections = [_HEADER]
    for heading, entries in COMMANDS.items():
        sections.append(f"## {heading}\n")
        for name in entries:
            sections += _sections(commands[name], f"omnisim {name}")
    return "\n".join(sections)


def _sections(command: typer.core.TyperCommand, name: str) -> Iterator[str]:
    context = typer.Context(command, info_name=name, terminal_width=_WIDTH)
    if isinstance(command, typer.core.TyperGroup):
        for child in command.list_commands(context):
            yield from _sections(command.commands[child], f"{name} {child}")
        return
    usage = command.get_usage(context).removeprefix("Usage: ")
    yield f"### {name}\n\n{_one_line(command.help or '')}\n\n```text\n{usage}\n```\n"
    records = [parameter.get_help_record(context) for parameter in command.get_params(context)]
    rows = [f"| `{_cell(names)}` | {_cell(text)} |" for names, text in filter(None, records)]
    yield "\n".join(["| option | meaning |", "| --- | --- |", *rows, ""])


def _cell(text: str) -> str:
    """A table's cell: a default in words is without its parentheses."""
    plain = re.sub(r"\[default: \((.*)\)\]", r"[default: \1]", _one_line(text))
    return plain.replace("[required]", "**Required.**").replace("|", "\\|")


def _one_line(text: str) -> str:
    return " ".join(text.split())
