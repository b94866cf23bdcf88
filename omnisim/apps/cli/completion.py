"""Names for shell completion and help pages; the shell itself completes paths.

Every key press starts the command, so registries are imported only when their names are needed.
"""

from __future__ import annotations

import json
import tomllib
from collections.abc import Callable, Iterable
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

from click.shell_completion import BashComplete, ZshComplete

from omnisim.core.package_files import LENSES, SCENES, built_in

if TYPE_CHECKING:
    import click

CATALOG = "catalog:"  # before the name of a camera of the catalog
CAMERA = "omnicamera"  # type of an omnidirectional camera in a run's manifest


def complete_scene(ctx: click.Context, incomplete: str) -> list[str]:
    """Complete the name of a built-in scene."""
    return _beginning(incomplete, built_in("scene.toml"))


def complete_robot(ctx: click.Context, incomplete: str) -> list[str]:
    """Complete the name of a built-in robot."""
    return _beginning(incomplete, built_in("robot.toml"))


def complete_camera(ctx: click.Context, incomplete: str) -> list[str]:
    """Complete a camera of the catalog level by level: its maker, its model, its mode."""
    wanted = incomplete.removeprefix(CATALOG)
    if wanted == incomplete:
        return _beginning(incomplete, [CATALOG])
    import lzma  # for cameras alone

    lines = lzma.decompress(LENSES.read_bytes()).decode().splitlines()
    found = _beginning(wanted, (line.partition("\t")[0] for line in lines))
    ends = (name.find("/", len(wanted)) + 1 or len(name) for name in found)
    levels = (CATALOG + name[:end] for name, end in zip(found, ends, strict=True))
    return list(dict.fromkeys(levels))


def complete_path(ctx: click.Context, incomplete: str) -> list[str]:
    """Complete the name of a path of the scene on the command line."""
    scene = _argument(ctx, "scene")
    file = scene if scene.suffix == ".toml" else scene / "scene.toml"
    if not file.is_file():
        file = SCENES / file
    try:
        paths = tomllib.loads(file.read_text(encoding="utf-8")).get("paths", [])
        return _beginning(incomplete, [path["name"] for path in paths])
    except (OSError, ValueError, KeyError, TypeError):
        return []


def complete_run_camera(ctx: click.Context, incomplete: str) -> list[str]:
    """Complete the name of a camera of the run on the command line."""
    manifest_file = _argument(ctx, "run", "source") / "manifest.json"
    try:
        sensors = json.loads(manifest_file.read_text(encoding="utf-8"))["sensors"].items()
        names = [name for name, sensor in sensors if sensor["type"] == CAMERA]
        return _beginning(incomplete, names)
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return []


def names_of(registry: str) -> Callable[[], Iterable[str]]:
    """Names in a registry of `omnisim`, such as ground_truth.channels.CHANNELS, once needed."""
    module, _, name = registry.rpartition(".")
    return lambda: getattr(import_module(f"omnisim.{module}"), name)


def complete_channels(ctx: click.Context, incomplete: str) -> list[str]:
    """Complete the last of comma-separated channels; channels before it are not repeated."""
    done, comma, last = incomplete.rpartition(",")
    names = names_of("ground_truth.channels.CHANNELS")()
    left = [name for name in (*names, "all") if name not in done.split(",")]
    return [f"{done}{comma}{name}" for name in _beginning(last, left)]


def _argument(ctx: click.Context, *names: str) -> Path:
    """Value of the argument with one of the names, or the first word that is not parsed yet."""
    parsed = (ctx.params.get(name) for name in names)
    unparsed = (word for word in ctx.args if not word.startswith("-"))
    return Path(next((word for word in (*parsed, *unparsed) if word is not None), ""))


def _beginning(incomplete: str, words: Iterable[str]) -> list[str]:
    return [word for word in words if word.startswith(incomplete)]


class Bash(BashComplete):
    """Completes names beside files, and names with colons, unlike the script of click."""

    def source(self) -> str:
        """Script of the shell."""
        self._check_version()
        return Path(__file__).with_name("completion.bash").read_text(encoding="utf-8")


class Zsh(ZshComplete):
    """Leaves the cursor behind a part of a name, which ends in : or /, without a blank."""

    source_template = ZshComplete.source_template.replace(
        "compadd -U -V unsorted -a completions",
        "compadd -U -S '' -V unsorted -- ${(M)completions:#*[:/]}\n"
        "        compadd -U -V unsorted -- ${completions:#*[:/]}",
    )
