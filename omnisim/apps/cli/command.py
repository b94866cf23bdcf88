"""Commands of click, made of requests when they are needed: parsing, messages and help pages."""

from __future__ import annotations

import re
import shutil
from collections.abc import Iterable, Iterator, Mapping, Sequence
from importlib import import_module
from itertools import takewhile
from typing import Any

import click
from click.core import ParameterSource
from click.shell_completion import CompletionItem

from omnisim.apps.cli.options import CommandEntry, CommandLineError, RequestField
from omnisim.core.errors import did_you_mean

HELP_FLAGS = ("-h", "--help", "--help-all")
MAX_COLUMNS = 100
_HYPHEN = "\u2011"  # at which click breaks no line


def _help_options(hidden: int) -> list[click.Option]:
    """Options that show the help page: the important options, or the hidden ones, too."""

    def show(ctx: click.Context, option: click.Parameter, is_given: bool) -> None:
        if is_given and not ctx.resilient_parsing:
            ctx.meta[HELP_FLAGS[-1]] = option.name == "help_all"
            click.echo(ctx.get_help())
            ctx.exit()

    shared: dict[str, Any] = {"is_flag": True, "is_eager": True, "expose_value": False}
    page = click.Option(HELP_FLAGS[:2], callback=show, help="Show this help.", **shared)
    text = f"Show all options ({hidden} more)."
    of_all = click.Option(HELP_FLAGS[2:], callback=show, help=text, hidden=not hidden, **shared)
    return [of_all, page]


class Command(click.Command):
    """Command of a request."""

    def __init__(self, entry: CommandEntry):
        name = entry.path.rpartition(" ")[2]
        super().__init__(name, help=entry.summary, add_help_option=False)
        self.allow_extra_args = True  # rejected below, in the same words as others
        self.entry = entry

    def get_params(self, ctx: click.Context) -> list[click.Parameter]:
        """Options and arguments, derived from the request."""
        if not self.params:
            self.params = [*map(_parameter, self.entry.fields), *_help_options(0)]
        return self.params

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Parse the words after the command's name."""
        if ctx.resilient_parsing:  # for completion
            return super().parse_args(ctx, args)
        line, words = _CommandLine(self.entry, args), tuple(args)  # click takes words away
        line.check_words()
        try:
            rest = super().parse_args(ctx, args)
        except click.NoSuchOption as error:
            raise line.unknown(error.option_name) from None
        except click.BadOptionUsage as error:
            value = next(word for word in words if word.startswith(f"{error.option_name}="))
            expected = f"expected no value, got {value.partition('=')[2]!r}"
            raise CommandLineError(f"{error.option_name}: {expected}") from None
        given = {
            name: words
            for name, words in ctx.params.items()
            if ctx.get_parameter_source(name) is ParameterSource.COMMANDLINE and words != ()
        }
        ctx.params = line.values(given, rest)
        return []

    def invoke(self, ctx: click.Context) -> None:
        """Run the command."""
        if self.entry.extra is not None:
            from omnisim.core.extras import require_extra

            require_extra(self.entry.extra, f"omnisim {self.entry.path}")
        module, _, function = self.entry.run.rpartition(".")
        run = getattr(import_module(f"omnisim.apps.cli.{module}"), function)
        request = self.entry.make(ctx.params)
        if (run(request) if self.entry.fields else run()) is False:
            ctx.exit(1)

    def format_help(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the summary, two examples, and the options: the important ones, or all of them."""
        formatter.width = min(shutil.get_terminal_size().columns, MAX_COLUMNS)
        _write_start(formatter, self.entry.summary, self.entry.examples)
        formatter.write_usage(f"omnisim {self.entry.path}", usage(self.entry))
        panels: dict[str, list[tuple[str, str]]] = {"Arguments": [], "Options": []}
        is_all = ctx.meta.get(HELP_FLAGS[-1], False)
        for field in self.entry.fields if is_all else _shown(self.entry):
            panel = "Arguments" if field.is_argument else field.panel if is_all else "Options"
            panels.setdefault(panel, []).append(help_row(field))
        for option in _help_options(len(self.entry.fields) - len(_shown(self.entry))):
            if not option.hidden and not (is_all and option.name == "help_all"):
                panels["Options"].append((", ".join(option.opts), option.help or ""))
        for panel, rows in panels.items():
            if rows:
                _write_rows(formatter, panel, rows)


class Group(click.Group):
    """Group of commands.

    Args:
        name: its name.
        summary: help text.
        commands: commands by name.
        default: command that runs if the first word names no command; empty: none.
    """

    def __init__(
        self, name: str, summary: str, commands: Mapping[str, click.Command], default: str = ""
    ):
        super().__init__(name, dict(commands), help=summary, add_help_option=False)
        self._default = default
        self.params = list(_help_options(0))

    def headings(self) -> Mapping[str, Iterable[tuple[str, str]]]:
        """Names and summaries of the commands, by the headings of the help page."""
        return {"Commands": [(name, each.help or "") for name, each in self.commands.items()]}

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Names of the commands in their order."""
        return list(self.commands)

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Parse the options before a command's name."""
        if self._default and args and args[0] not in (*self.commands, *HELP_FLAGS):
            args = [self._default, *args]
        if not args and not ctx.resilient_parsing:
            args = ["--help"]
        words = tuple(args)  # click takes words away
        try:
            return super().parse_args(ctx, args)
        except click.NoSuchOption as error:
            word = next(word for word in words if word.startswith(error.option_name))
            flags = [flag for option in self.params for flag in option.opts]
            raise unknown(word, "option", ctx.command_path, flags) from None

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Find a command by its name."""
        names = self.list_commands(ctx)
        if not ctx.resilient_parsing and args[0] not in names:
            raise unknown(args[0], "command", ctx.command_path, names)
        return super().resolve_command(ctx, args)

    def shell_complete(self, ctx: click.Context, incomplete: str) -> list[CompletionItem]:
        """Complete the name of a command, or the argument of the default one."""
        names = super().shell_complete(ctx, incomplete)
        if not self._default:
            return names
        arguments = [
            parameter
            for parameter in self.commands[self._default].get_params(ctx)
            if isinstance(parameter, click.Argument)
        ]
        return names + arguments[0].shell_complete(ctx, incomplete)

    def format_help(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the summary, and the commands below their headings."""
        formatter.width = min(shutil.get_terminal_size().columns, MAX_COLUMNS)
        _write_start(formatter, self.help or "", ())
        formatter.write_usage(ctx.command_path, "COMMAND …")
        for heading, rows in self.headings().items():
            _write_rows(formatter, heading, rows)
        rows = [
            (", ".join(option.opts), option.help or "")
            for option in self.params
            if isinstance(option, click.Option) and not option.hidden
        ]
        _write_rows(formatter, "Options", rows)


def _write_start(formatter: click.HelpFormatter, summary: str, examples: Iterable[str]) -> None:
    formatter.write_text(summary.replace("-", _HYPHEN))
    formatter.write_paragraph()
    for example in examples:
        formatter.write(f"  {example}\n")
    if examples:
        formatter.write_paragraph()


def _write_rows(
    formatter: click.HelpFormatter, heading: str, rows: Iterable[tuple[str, str]]
) -> None:
    """Write names and help texts below a heading; no word is broken at its hyphens."""
    with formatter.section(heading):
        formatter.write_dl([(name, text.replace("-", _HYPHEN)) for name, text in rows], col_max=32)
    formatter.buffer[:] = [text.replace(_HYPHEN, "-") for text in formatter.buffer]


def _shown(entry: CommandEntry) -> list[RequestField]:
    """Arguments and important options of a command, in the order of their importance."""
    fields = {field.name: field for field in entry.fields}
    if not entry.first:
        return list(fields.values())
    arguments = [field for field in fields.values() if field.is_argument]
    return arguments + [fields[name] for name in entry.first]


def usage(entry: CommandEntry) -> str:
    """Arguments of a command, in its usage."""
    arguments = (field for field in entry.fields if field.is_argument)
    names = (field.metavar if field.is_required else f"[{field.label}]" for field in arguments)
    return " ".join((*names, "[OPTIONS]"))


def help_row(field: RequestField) -> tuple[str, str]:
    """Flags with the placeholder of an option, and its help with its default."""
    is_required = field.is_required and not field.is_argument
    text = f"{field.text} Required." if is_required else field.text
    name = field.metavar if field.is_argument else ", ".join(field.flags)
    return name if field.is_argument or field.is_flag else f"{name} {field.metavar}", text


def _parameter(field: RequestField) -> click.Parameter:
    """Option or argument of click, which leaves the reading of values to the field."""

    def complete(
        ctx: click.Context, parameter: click.Parameter, incomplete: str
    ) -> list[CompletionItem]:
        details = field.details
        names = details.names() if details.names else field.choices
        words = (
            [name for name in names if name.startswith(incomplete)]
            if details.complete is None
            else details.complete(ctx, incomplete)
        )
        files = {"DIR": "dir", "RUN": "dir", "FILE": "file", "SCENE": "file"}
        items = [CompletionItem(word) for word in words]
        shown = {files[part] for part in re.findall(r"\w+", field.metavar) if part in files}
        return items + [CompletionItem(incomplete, type=kind) for kind in sorted(shown)]

    if field.is_flag:
        return click.Option([*field.flags, field.name], is_flag=True, default=None)
    shared: dict[str, Any] = {"type": click.UNPROCESSED, "shell_complete": complete}
    if field.is_argument:
        count = -1 if field.is_list else 1
        return click.Argument([field.name], required=False, nargs=count, **shared)
    shared |= {"multiple": field.is_list, "nargs": field.word_count}
    return click.Option([*field.flags, field.name], **shared)


class _CommandLine:
    """Words after a command's name: what is wrong with them, in one line."""

    def __init__(self, entry: CommandEntry, words: Sequence[str]):
        self._entry, self._path = entry, f"omnisim {entry.path}"
        self._fields = entry.fields
        self._words = list(words[: words.index("--")] if "--" in words else words)
        options = (field for field in self._fields if not field.is_argument)
        self._by_flag = {
            flag: field for field in options for flags in field.flags for flag in flags.split("/")
        }

    def check_words(self) -> None:
        """Reject an option without its value, which would take the next option for one."""
        for _, flag, field, words in self._given():
            if len(words) < field.word_count:
                raise field.error(" ".join(words) or "nothing", flag)

    def values(self, given: Mapping[str, Any], rest: Sequence[str]) -> dict[str, Any]:
        """Values by name of the field, from the words of each field and those that no option takes.

        Raises:
            CommandLineError: names the option, or the word.
        """
        values = {}
        for field in self._fields:
            if field.name in given:
                words = given[field.name]
                read = [field.read(each) for each in words] if field.is_list else words
                values[field.name] = read if field.is_list or field.is_flag else field.read(words)
        missing = [
            field for field in self._fields if field.is_required and field.name not in values
        ]
        for field in sorted(missing, key=lambda field: not field.is_argument):
            text = " ".join(re.split(r"\.\s|;|\.$", field.text, maxsplit=1)[0].split())
            example = [field.label, field.example]
            if field.is_argument:
                arguments = [each for each in self._fields if each.is_argument]
                example = [self._path, *(each.example for each in arguments if each.is_required)]
            raise CommandLineError(f"{field.label}: missing: {text}, such as {' '.join(example)}")
        if rest:
            raise self._excess(rest[0])
        return values

    def unknown(self, option: str) -> CommandLineError:
        """Error for an option that the command does not have."""
        word = next((word for word in self._words if word.startswith(option)), option)
        if other := self._entry.elsewhere.get(option):
            return CommandLineError(f"{option}: {self._path} has no such option; {other} has it")
        return unknown(word, "option", self._path, (*self._by_flag, *HELP_FLAGS))

    def _excess(self, word: str) -> CommandLineError:
        """Error for a word that neither an option nor an argument takes."""
        for at, flag, field, taken in self._given():
            words = [*taken, *self._words[at + 1 + len(taken) :][:1]]
            if not taken or words[len(taken) :] != [word]:
                continue
            example = " ".join(f"{flag} {value}" for value in words)
            if "comma-separated" in field.text:
                example = f"{flag} {','.join(words)}"
            elif not field.is_list:
                return field.error(" ".join(words), flag)
            return CommandLineError(f"{flag}: expected {example}, got {flag} {' '.join(words)}")
        takes = " ".join(field.metavar for field in self._fields if field.is_argument) or "nothing"
        takes = f"{self._path} takes {takes} besides its options"
        return CommandLineError(f"{word}: unexpected argument: {takes}")

    def _given(self) -> Iterator[tuple[int, str, RequestField, list[str]]]:
        """Places of flags, flags, their fields, and the words of their values."""
        for at, word in enumerate(self._words):
            if (field := self._by_flag.get(word)) is not None:
                values = self._words[at + 1 : at + 1 + field.word_count]
                taken = list(takewhile(lambda each: each not in self._by_flag, values))
                yield at, word, field, taken


def unknown(word: str, noun: str, path: str, known: Iterable[str]) -> CommandLineError:
    """Error for an unknown command or option of a command, with the nearest known one."""
    name = word.partition("=")[0]
    by_letters = {each.lstrip("-"): each for each in known}  # -size is --size, too
    near = did_you_mean(name.lstrip("-"), by_letters, "")
    hint = f"see {path} --help"
    if near.startswith("did"):
        hint = re.sub("'(.+?)'", lambda found: repr(by_letters[found[1]]), near)
    return CommandLineError(f"{name}: {path} has no such {noun}; {hint}")
