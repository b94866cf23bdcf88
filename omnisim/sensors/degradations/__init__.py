"""Degradations of real cameras: parameters, presets, passes on the GPU and their reference."""

from omnisim.sensors.degradations.bayer import Bayer
from omnisim.sensors.degradations.chromatic_aberration import ChromaticAberration
from omnisim.sensors.degradations.defocus import Defocus
from omnisim.sensors.degradations.degradation import Degradation
from omnisim.sensors.degradations.degradation_file import preset, preset_names
from omnisim.sensors.degradations.dirt import Dirt
from omnisim.sensors.degradations.encoding import Encoding
from omnisim.sensors.degradations.exposure import Exposure
from omnisim.sensors.degradations.jpeg import Jpeg
from omnisim.sensors.degradations.noise import Noise
from omnisim.sensors.degradations.reflectance import Reflectance
from omnisim.sensors.degradations.shutter import Shutter
from omnisim.sensors.degradations.vignetting import Vignetting
from omnisim.sensors.degradations.white_balance import WhiteBalance

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
    "Reflectance",
    "Shutter",
    "Vignetting",
    "WhiteBalance",
    "preset",
    "preset_names",
]
