"""What a result was measured on, for the result file."""

from __future__ import annotations

import os
import platform
import re
import subprocess
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import moderngl

from omnisim.version import __version__

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("moderngl", "numpy", "trimesh", "OpenImageIO", "embreex", "pyrender")
# What draws without a GPU, as it calls itself.
SOFTWARE = ("llvmpipe", "softpipe", "swrast", "lavapipe")


def about(context: moderngl.Context, device: int | None = None) -> dict[str, Any]:
    """Machine, driver, versions, commit and time.

    Args:
        context: what draws.
        device: its number, if it was chosen by one.
    """
    renderer = context.info["GL_RENDERER"]
    is_software = any(name in renderer.lower() for name in SOFTWARE)
    return {
        "name": _name(renderer, is_software),
        "time": datetime.now(UTC).isoformat(timespec="seconds"),
        "processor": _processor(),
        "cores": _cores(),
        "load": os.getloadavg()[0],
        "system": platform.platform(),
        "device": device,
        "renderer": renderer,
        "vendor": context.info["GL_VENDOR"],
        "opengl": context.info["GL_VERSION"],
        "is_software": is_software,
        "python": platform.python_version(),
        "omnisim": __version__,
        "packages": {name: _version(name) for name in PACKAGES},
        "commit": _commit(),
    }


def in_words(machine: dict[str, Any]) -> str:
    """A line that says what drew, and on what."""
    kind = "software" if machine["is_software"] else "GPU"
    return (
        f"{machine['renderer']} ({kind}), {machine['processor']}, {machine['cores']} cores, "
        f"load {machine['load']:.1f}, commit {machine['commit'] or 'unknown'}"
    )


def _name(renderer: str, is_software: bool) -> str:
    """A folder's name for results: what decides the numbers, and no host's name."""
    plain = re.sub(r"[^a-z0-9]+", "-", re.split(r"[/(]", renderer.lower())[0]).strip("-")
    return f"{plain}-{_cores()}-cores" if is_software else plain


def _cores() -> int:
    """Those that this process may use."""
    return len(os.sched_getaffinity(0))


def _version(package: str) -> str | None:
    try:
        return version(package)
    except PackageNotFoundError:
        return None  # an optional one


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor()
    names = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    return next(names, platform.processor())


def _commit() -> str | None:
    """The commit, with + where files were changed since; None outside a checkout."""
    try:
        done = subprocess.run(
            ["git", "describe", "--always", "--dirty=+", "--abbrev=12"],
            cwd=ROOT, capture_output=True, text=True, check=True,
        )  # fmt: skip
    except (OSError, subprocess.CalledProcessError):
        return None
    return done.stdout.strip()
