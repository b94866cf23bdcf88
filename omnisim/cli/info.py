"""`omnisim info`."""

from __future__ import annotations

import platform
from importlib.metadata import version

from rich.console import Console
from rich.table import Table

from omnisim import __version__
from omnisim.errors import GraphicsError
from omnisim.gpu.context import list_devices, open_context
from omnisim.scene import builtin_scenes

PACKAGES = ("moderngl", "numpy", "trimesh", "OpenImageIO", "pydantic")


def run(out: Console) -> None:
    """Print versions, built-in scenes and what each GPU offers.

    Raises:
        GraphicsError: there is no OpenGL to use; says how to get one.
    """
    out.print(f"omnisim {__version__}, Python {platform.python_version()}")
    out.print(", ".join(f"{name} {version(name)}" for name in PACKAGES))
    out.print("built-in scenes: " + (", ".join(builtin_scenes()) or "none"))
    table = Table("device", "renderer", "vendor", "OpenGL", "largest picture", "samples")
    devices = list_devices()
    if not devices:
        open_context().release()  # raises, and says why
    for number, device in devices:
        if isinstance(device, GraphicsError):
            table.add_row(str(number), f"cannot be used: {device}", "", "", "", "")
            continue
        limit = f"{device.max_texture_size_px} px"
        table.add_row(
            str(number), device.renderer, device.vendor, device.version, limit,
            str(device.max_samples),
        )  # fmt: skip
    out.print(table)
