"""Degradations of real cameras: parameters, presets, GPU passes and a NumPy reference."""

from typing import TYPE_CHECKING

from omnisim.core.lazy_names import lazy_names
from omnisim.core.package_files import preset_names
from omnisim.rendering.camera.degradations.degradation import EFFECT_MODULES, Degradation

if TYPE_CHECKING:
    from omnisim.rendering.camera.degradations.bayer import Bayer
    from omnisim.rendering.camera.degradations.chromatic_aberration import ChromaticAberration
    from omnisim.rendering.camera.degradations.defocus import Defocus
    from omnisim.rendering.camera.degradations.degradation_file import preset
    from omnisim.rendering.camera.degradations.dirt import Dirt
    from omnisim.rendering.camera.degradations.encoding import Encoding
    from omnisim.rendering.camera.degradations.exposure import Exposure
    from omnisim.rendering.camera.degradations.jpeg import Jpeg
    from omnisim.rendering.camera.degradations.noise import Noise
    from omnisim.rendering.camera.degradations.point_spread import PointSpread
    from omnisim.rendering.camera.degradations.reflectance import Reflectance
    from omnisim.rendering.camera.degradations.shutter import Shutter
    from omnisim.rendering.camera.degradations.vignetting import Vignetting
    from omnisim.rendering.camera.degradations.white_balance import WhiteBalance

_MODULES = {**EFFECT_MODULES, "preset": "degradation_file"}
__all__ = [
    "Bayer",
    "ChromaticAberration",
    "Defocus",
    "Degradation",
    "Dirt",
    "Encoding",
    "Exposure",
    "Jpeg",
    "Noise",
    "PointSpread",
    "Reflectance",
    "Shutter",
    "Vignetting",
    "WhiteBalance",
    "preset",
    "preset_names",
]

__getattr__ = lazy_names(__name__, _MODULES)
