"""Degradations of real cameras: parameters, presets, GPU passes and a NumPy reference."""

from omnisim.core.package_files import preset_names
from omnisim.rendering.camera.degradations import degradation as effects
from omnisim.rendering.camera.degradations.degradation import *  # noqa: F403  # its effects
from omnisim.rendering.camera.degradations.degradation_file import preset

__all__ = ["preset", "preset_names"]
__all__ += effects.__all__
