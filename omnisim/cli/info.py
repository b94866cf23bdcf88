"""`omnisim info`."""

from __future__ import annotations

import platform
from importlib.metadata import version

from rich.table import Table

from omnisim.cli.console import out
from omnisim.errors import GraphicsError
from omnisim.gpu.context import GraphicsInfo, list_devices, open_context
from omnisim.scene import builtin_scenes
from omnisim.version import __version__

PACKAGES = ("moderngl", "numpy", "trimesh", "OpenImageIO", "pydantic")


def run() -> None:
    """Print versions, built-in scenes and the capabilities of each GPU.

    Raises:
        GraphicsError: there is no usable OpenGL; with the way to install one.
    """
    out.print(f"omnisim {__version__}, Python {platform.python_version()}")
    out.print(", ".join(f"{name} {version(name)}" for name in PACKAGES))
    out.print("built-in scenes: " + (", ".join(builtin_scenes()) or "none"))
    devices = list_devices()
    usable = [(number, found) for number, found in devices if isinstance(found, GraphicsInfo)]
    for number, found in devices:
        if isinstance(found, GraphicsError):
            out.print(f"device {number} cannot be used: {found}", markup=False)
    if not usable:
        open_context().release()  # raises with the reason
    table = Table("device", "renderer", "vendor", "OpenGL", "largest picture", "samples")
    for number, device in usable:
        largest = f"{device.max_texture_size_px} px"
        samples = str(device.max_samples)
        table.add_row(str(number), device.renderer, device.vendor, device.version, largest, samples)
    out.print(table)
