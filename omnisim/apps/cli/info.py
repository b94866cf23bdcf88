"""`omnisim info`: versions, built-in scenes, and the GPUs that can render."""

from __future__ import annotations

import platform
import sys
from collections.abc import Mapping
from contextlib import suppress
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from rich.table import Table

from omnisim.apps.cli.cameras.sensor import mesh_text
from omnisim.apps.cli.console import out
from omnisim.cameras import summary
from omnisim.core import extras
from omnisim.core.version import __version__
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.robots import builtin_robots
from omnisim.scene import builtin_scenes

PACKAGE = Path(__file__).resolve().parents[2]


def run() -> None:
    """Print the installation, built-in scenes and robots, and the OpenGL devices."""
    lines = installation()
    width = max(len(name) for name, _ in lines) + 2
    for name, text in lines:
        out.print(f"{name:{width}}{text}")
    extras.require_opengl("the list of devices")
    from omnisim.rendering.opengl.gl.context import (
        GraphicsInfo,
        graphics_info,
        list_devices,
        open_context,
    )
    from omnisim.rendering.opengl.gl.diagnosis import cuda_numbers

    context = open_context()  # raises with the reason
    used = graphics_info(context)
    context.release()
    out.print(f"{'renderer':{width}}{used.renderer}, OpenGL {used.version}")
    table = Table("device", "renderer", "vendor", "OpenGL", "largest texture", "samples")
    for (number, device), cuda in zip(list_devices(), cuda_numbers(), strict=True):
        if not isinstance(device, GraphicsInfo):
            out.print(f"device {number} cannot be used: {device}")
            continue
        name = f"{number}" if cuda is None else f"{number}, cuda:{cuda}"
        largest = f"{device.max_texture_size_px} px"
        samples = str(device.max_samples)
        table.add_row(name, device.renderer, device.vendor, device.version, largest, samples)
    out.print(table)


def installation() -> list[tuple[str, str]]:
    """Names and values of all lines except OpenGL's."""
    system = f"{platform.system()} {platform.release()}"
    with suppress(OSError, KeyError):  # Debian GNU/Linux 12 (bookworm), Linux 6.1.0
        system = f"{platform.freedesktop_os_release()['PRETTY_NAME']}, {system}"
    lines = [
        ("omnisim", f"{__version__}, in {PACKAGE}"),
        ("python", f"{platform.python_version()}, {sys.executable}"),
        ("system", f"{system}, {platform.machine()}"),
        ("packages", _versions(extras.REQUIRED)),
    ]
    for extra, packages in extras.EXTRAS.items():
        missing = extras.missing_packages(extra)
        versions = _versions({name: packages[name] for name in packages if name not in missing})
        lacking = f"no {', '.join(missing)}: {extras.install_hint(extra)}" if missing else ""
        lines.append((extra, "; ".join(filter(None, (versions, lacking)))))
    camera = OmniCamera()
    lines += [
        ("scenes", ", ".join(builtin_scenes()) or "none"),
        ("robots", ", ".join(builtin_robots()) or "none"),
        ("camera", f"{summary(camera.model)}, {mesh_text(camera)}"),
    ]
    return lines


def _versions(packages: Mapping[str, str]) -> str:
    versions = []
    for name, module in packages.items():
        try:
            text = version(name)
        except PackageNotFoundError:  # not installed as a Python package, as is often so for OpenCV
            text = "of unknown version" if extras.is_installed(module) else "missing"
        versions.append(f"{name} {text}")
    return ", ".join(versions)
