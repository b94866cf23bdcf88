"""Machine, driver, versions and commit of a report."""

from __future__ import annotations

import os
import platform
import re
import subprocess
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import TYPE_CHECKING, Any

from omnisim.core.extras import require_opengl
from omnisim.core.version import __version__

if TYPE_CHECKING:  # OpenGL may be missing
    from omnisim.rendering.opengl.gl.context import GraphicsInfo

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = (
    "moderngl", "numpy", "trimesh", "OpenImageIO", "embreex", "pyrender", "mitsuba",
    "opencv-contrib-python-headless",
)  # fmt: skip
SOFTWARE = ("llvmpipe", "softpipe", "swrast", "lavapipe")  # in the names of software renderers


def machine_of_device(device: int | None = None) -> dict[str, Any]:
    """Machine, driver and versions, see `describe_machine`; opens the GPU for a moment.

    Raises:
        GraphicsError: no OpenGL.
    """
    require_opengl("validation")
    from omnisim.rendering.opengl.gl.context import graphics_info, open_context

    context = open_context(device)
    try:
        return describe_machine(graphics_info(context), device)
    finally:
        context.release()


def describe_machine(graphics: GraphicsInfo, device: int | None = None) -> dict[str, Any]:
    """Machine, driver, versions, commit and time, of JSON types.

    Args:
        graphics: OpenGL renderer and driver.
        device: EGL index of the GPU; None: not chosen.
    """
    return {
        "name": _name(graphics.renderer),
        "time": datetime.now(UTC).isoformat(timespec="seconds"),
        "processor": _processor(),
        "cores": _cores(),
        "load": os.getloadavg()[0],
        "system": platform.platform(),
        "device": device,
        "renderer": graphics.renderer,
        "vendor": graphics.vendor,
        "opengl": graphics.version,
        "is_software": is_software(graphics.renderer),
        "python": platform.python_version(),
        "omnisim": __version__,
        "packages": {name: _version(name) for name in PACKAGES},
        "commit": _commit(),
    }


def machine_line(machine: dict[str, Any]) -> str:
    """Renderer, processor, load and commit in one line."""
    kind = "software" if machine["is_software"] else "GPU"
    return (
        f"{machine['renderer']} ({kind}), {machine['processor']}, {machine['cores']} cores, "
        f"load {machine['load']:.1f}, commit {machine['commit'] or 'unknown'}"
    )


def is_software(renderer: str) -> bool:
    """True if OpenGL's renderer is no GPU."""
    return any(name in renderer.lower() for name in SOFTWARE)


def _name(renderer: str) -> str:
    """Folder name for results: the renderer, with the cores of a software renderer."""
    plain = re.sub(r"[^a-z0-9]+", "-", re.split(r"[/(]", renderer.lower())[0]).strip("-")
    return f"{plain}-{_cores()}-cores" if is_software(renderer) else plain


def _cores() -> int:
    return len(os.sched_getaffinity(0))


def _version(package: str) -> str | None:
    try:
        return version(package)
    except PackageNotFoundError:
        return None  # an optional package


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor()
    names = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    return next(names, platform.processor())


def _commit() -> str | None:
    """Commit, with + if files have changed since; None outside a checkout."""
    if not (ROOT / ".git").exists():
        return None
    try:
        done = subprocess.run(
            ["git", "describe", "--always", "--dirty=+", "--abbrev=12"],
            cwd=ROOT, capture_output=True, text=True, check=True,
        )  # fmt: skip
    except (OSError, subprocess.CalledProcessError):
        return None
    return done.stdout.strip()
