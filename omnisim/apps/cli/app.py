"""Command-line application and its error handling.

Commands, and the functions of `omnisim.apps.cli` that read what they need, raise OmnisimError for
every fault that a user can fix.
"""

from __future__ import annotations

import errno
import os
import sys
import warnings
from collections.abc import Iterable, Mapping
from importlib import import_module
from pathlib import Path
from typing import Any, NoReturn

import click
from click.shell_completion import add_completion_class, get_completion_class, shell_complete

from omnisim.apps.cli import completion
from omnisim.apps.cli.command import Command, Group
from omnisim.apps.cli.console import print_note
from omnisim.apps.cli.options import ENTRIES, CommandLineError
from omnisim.core.errors import NoticeWarning, OmnisimError
from omnisim.core.version import __version__

for _kind in (completion.Bash, completion.Zsh):
    add_completion_class(_kind)
COMPLETE = "_OMNISIM_COMPLETE"  # variable by which a shell asks for completions
# By shell: the file with its script, the file that runs it, and how.
_SHELLS = {
    "bash": (".bash_completions/omnisim.sh", ".bashrc", "source ~/.bash_completions/omnisim.sh"),
    "zsh": (".zfunc/omnisim.zsh", ".zshrc", "source ~/.zfunc/omnisim.zsh"),
    "fish": (".config/fish/completions/omnisim.fish", "", ""),
}
# By heading and name: the folder whose module `requests` has the command, or those of the group.
COMMANDS: dict[str, dict[str, str]] = {
    "Images": dict.fromkeys(("render", "live", "unwarp", "scan"), "images"),
    "Runs": dict.fromkeys(
        ("drive", "record", "serve", "evaluate", "plot", "video", "export", "localize",
         "landmarks", "robot"),
        "runs",
    ),
    "Data sets": dict.fromkeys(("generate", "dataset"), "datasets"),
    "Worlds": dict.fromkeys(("scene", "bake"), "worlds"),
    "Cameras": dict.fromkeys(("sensor", "mirror", "calibration"), "cameras")
    | {"measure": "measure", "optics": "cameras"},
    "Checks": dict.fromkeys(("doctor", "schema", "info", "validate", "experiments"), "checks"),
}  # fmt: skip
GROUPS = {  # help texts of the groups
    "landmarks": "Learn the colors of landmarks, and detect them.",
    "robot": "Robots: list, show, check, or import from USARSim, Gazebo, URDF or MuJoCo.",
    "dataset": "Data sets: summarize, check the hashes, view samples, convert.",
    "scene": "Scenes: summarize (`omnisim scene SCENE`), or convert to GLB.",
    "calibration": "Calibration files of other tools: convert, show, check, list the formats.",
    "measure": "Measure a camera from its own images.",
    "optics": "Non-central optical systems: check, plot, design, calibrate.",
}


class _Omnisim(Group):
    """Top-level group, whose commands are made when they are named."""

    def __init__(self) -> None:
        super().__init__(
            "omnisim", "Simulator of omnidirectional cameras, accurate to a tenth of a pixel.", {}
        )
        self.params += [
            click.Option(
                [flag], callback=callback, help=text, is_eager=True, expose_value=False, **kind
            )
            for flag, callback, text, kind in (
                ("--version", _print_version, "Print the version.", {"is_flag": True}),
                ("--install-completion", _install, "Install completion for the shell.",
                 {"is_flag": True}),
                ("--show-completion", _show_script, "Print the completion script for a shell.",
                 {"metavar": "bash|zsh|fish"}),
            )
        ]  # fmt: skip

    def headings(self) -> Mapping[str, Iterable[tuple[str, str]]]:
        """Names and summaries of all commands, by heading."""
        return {
            heading: [(name, command_named(name).help or "") for name in modules]
            for heading, modules in COMMANDS.items()
        }

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Names of all commands."""
        return [name for modules in COMMANDS.values() for name in modules]

    def get_command(self, ctx: click.Context, cmd_name: str) -> Command | Group | None:
        """Command of a name."""
        return command_named(cmd_name) if cmd_name in self.list_commands(ctx) else None


def command_named(name: str) -> Command | Group:
    """Command or group of the table `COMMANDS`."""
    module = next(modules[name] for modules in COMMANDS.values() if name in modules)
    import_module(f"omnisim.apps.cli.{module}.requests")
    if name not in GROUPS:
        return Command(ENTRIES[name])
    commands = {
        path.removeprefix(f"{name} "): Command(entry)
        for path, entry in ENTRIES.items()
        if path.startswith(f"{name} ")
    }
    return Group(name, GROUPS[name], commands, default="show" if name == "scene" else "")


def _print_version(ctx: click.Context, option: click.Parameter, is_given: bool) -> None:
    if is_given:
        click.echo(f"omnisim {__version__}")
        ctx.exit()


def _script(ctx: click.Context, shell: str) -> str:
    kind = get_completion_class(shell) if shell in _SHELLS else None
    if kind is None:
        raise CommandLineError(f"completion: expected one of {', '.join(_SHELLS)}, got {shell!r}")
    return kind(ctx.command, {}, "omnisim", COMPLETE).source()


def _show_script(ctx: click.Context, option: click.Parameter, shell: str | None) -> None:
    if shell is not None:
        click.echo(_script(ctx, shell))
        ctx.exit()


def _install(ctx: click.Context, option: click.Parameter, is_given: bool) -> None:
    """Write the completion script, and its call into the shell's start-up file."""
    if not is_given:
        return
    shell, home = Path(os.environ.get("SHELL", "")).name, Path.home()
    script = _script(ctx, shell)
    file, start_up, call = _SHELLS[shell]
    (home / file).parent.mkdir(parents=True, exist_ok=True)
    (home / file).write_text(script, encoding="utf-8")
    before = home / start_up
    text = before.read_text(encoding="utf-8") if call and before.exists() else ""
    if call and call not in text:
        before.write_text(f"{text.rstrip()}\n\n{call}\n".lstrip(), encoding="utf-8")
    click.echo(f"{home / file}: completes in new terminals")
    ctx.exit()


app = _Omnisim()


def main() -> None:
    """Run the command line; an OmnisimError prints its message and exits with its status."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("always", NoticeWarning)
            _print_notices()
            if asked := os.environ.get(COMPLETE):
                sys.exit(shell_complete(app, {}, "omnisim", COMPLETE, asked))
            with app.make_context("omnisim", sys.argv[1:]) as ctx:
                app.invoke(ctx)
    except click.exceptions.Exit as stopped:
        sys.exit(stopped.exit_code)
    except click.UsageError as error:
        _fail(error.format_message(), CommandLineError.exit_status)
    except OmnisimError as error:
        _fail(str(error), error.exit_status)
    except OSError as error:
        if error.filename is not None:
            raise
        if error.errno == errno.ENOENT:  # from getcwd
            _fail("the working directory no longer exists")
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)  # else flushing at exit fails again
        _fail(f"standard output: cannot be written: {error.strerror}")
    sys.exit()


def _print_notices() -> None:
    """Print each notice about a file once, as a note."""
    printed: set[str] = set()
    show = warnings.showwarning

    def show_warning(message: Any, category: Any, *place: Any, **more: Any) -> None:
        if not issubclass(category, NoticeWarning):
            show(message, category, *place, **more)
        elif str(message) not in printed:
            printed.add(str(message))
            print_note(str(message))

    warnings.showwarning = show_warning


def _fail(message: str, status: int = 1) -> NoReturn:
    for word in sys.argv[1:]:  # a name with line breaks: still one line
        message = message.replace(word, " ".join(word.splitlines())) if word else message
    for line in message.splitlines():
        click.echo(f"{click.style('error:', fg='red', bold=True)} {line}", err=True)
    sys.exit(status)
