"""Command-line reference from the requests of the commands, as the help pages are."""

from __future__ import annotations

from collections.abc import Iterator

from omnisim.apps.cli.app import COMMANDS, command_named
from omnisim.apps.cli.command import Command, Group, help_row, usage
from omnisim.apps.cli.options import CommandEntry

_HEADER = """# Command line

Every command ends with status 0, or with one line that says what was wrong and status 1; a wrong
option ends with status 2. `omnisim COMMAND --help` prints its most important options, and
`--help-all` all of these.
"""


def command_line_page() -> str:
    """Markdown of all commands, those of groups included."""
    sections = [_HEADER]
    for heading, names in COMMANDS.items():
        sections.append(f"## {heading}\n")
        for name in names:
            sections += map(_section, _entries(command_named(name)))
    return "\n".join(sections)


def _entries(command: Command | Group) -> Iterator[CommandEntry]:
    if isinstance(command, Command):
        yield command.entry
        return
    for child in command.commands.values():
        assert isinstance(child, Command)
        yield child.entry


def _section(entry: CommandEntry) -> str:
    lines = [f"### omnisim {entry.path}\n", f"{entry.summary}\n", "```text"]
    lines += [f"omnisim {entry.path} {usage(entry)}".rstrip(), "", *entry.examples, "```\n"]
    if entry.fields:
        lines += ["| option | meaning |", "| --- | --- |"]
    for field in entry.fields:
        name, text = (part.replace("|", "\\|") for part in help_row(field))
        lines.append(f"| `{name}` | {text.replace('Required.', '**Required.**')} |")
    return "\n".join([*lines, ""])
