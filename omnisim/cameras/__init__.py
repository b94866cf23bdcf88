"""Camera models: map pixels to viewing rays, and rays to pixels.

Each model has two files with the same stem: `cameras/models/<model>.py` or
`cameras/mirrors/<model>.py` (NumPy, float64, the reference), and `shaders/camera/<model>.glsl` (its
twin on the GPU). Its class is listed in `camera_registry.py`, its module in this file, and an
example for the contract test in `tests/camera_examples.py`. All models share these conventions:

- Pixels are (u, v), u right and v down, (0, 0) at the center of the top left pixel.
- Rays are unit directions in the optical frame (x right, y down, z forward), from the effective
  viewpoint. `omnisim.core.coordinate_frames` lists all frames.
- For a pixel outside the domain, or a direction that the camera cannot see, `valid` is False and
  the value is finite but meaningless; this is data, not an error.
"""

from typing import TYPE_CHECKING

from omnisim.cameras.camera import (
    CameraSensor,
    CentralCamera,
    NonCentralCamera,
    Pixels,
    Rays,
    check_central,
    pixel_grid,
    pixels_of_points,
    summary,
)
from omnisim.cameras.parametric_camera import ParametricCamera
from omnisim.core.lazy_names import lazy_names

if TYPE_CHECKING:
    from omnisim.cameras.camera_registry import CAMERA_MODELS, camera_from_parameters
    from omnisim.cameras.f_theta_inverse import FThetaInverseCamera
    from omnisim.cameras.mirrored import MirroredCamera
    from omnisim.cameras.mirrors.elliptic import EllipticCamera
    from omnisim.cameras.mirrors.hyperbolic import HyperbolicCamera
    from omnisim.cameras.mirrors.parabolic import ParabolicCamera
    from omnisim.cameras.mirrors.planar import PlanarCamera
    from omnisim.cameras.models.cylindrical import CylindricalCamera, period_px
    from omnisim.cameras.models.division import DivisionCamera
    from omnisim.cameras.models.double_sphere import DoubleSphereCamera
    from omnisim.cameras.models.equidistant import EquidistantCamera
    from omnisim.cameras.models.equirectangular import EquirectangularCamera
    from omnisim.cameras.models.equisolid import EquisolidCamera
    from omnisim.cameras.models.eucm import EucmCamera
    from omnisim.cameras.models.f_theta import FThetaCamera
    from omnisim.cameras.models.gazebo import GazeboCamera
    from omnisim.cameras.models.kannala_brandt import KannalaBrandtCamera
    from omnisim.cameras.models.ocamcalib import OcamcalibCamera
    from omnisim.cameras.models.orthographic import OrthographicCamera
    from omnisim.cameras.models.perspective import PerspectiveCamera
    from omnisim.cameras.models.radial_table import RadialTableCamera
    from omnisim.cameras.models.rational_polynomial import RationalPolynomialCamera
    from omnisim.cameras.models.stereographic import StereographicCamera
    from omnisim.cameras.models.thin_prism_fisheye import ThinPrismFisheyeCamera
    from omnisim.cameras.models.unified import UnifiedCamera

# Modules by exported name, imported at first use: most images need only one camera model.
_MODULES = {
    "CAMERA_MODELS": "camera_registry",
    "camera_from_parameters": "camera_registry",
    "FThetaInverseCamera": "f_theta_inverse",
    "period_px": "models.cylindrical",
    "MirroredCamera": "mirrored",
    "EllipticCamera": "mirrors.elliptic",
    "HyperbolicCamera": "mirrors.hyperbolic",
    "ParabolicCamera": "mirrors.parabolic",
    "PlanarCamera": "mirrors.planar",
    "CylindricalCamera": "models.cylindrical",
    "DivisionCamera": "models.division",
    "DoubleSphereCamera": "models.double_sphere",
    "EquidistantCamera": "models.equidistant",
    "EquirectangularCamera": "models.equirectangular",
    "EquisolidCamera": "models.equisolid",
    "EucmCamera": "models.eucm",
    "FThetaCamera": "models.f_theta",
    "GazeboCamera": "models.gazebo",
    "KannalaBrandtCamera": "models.kannala_brandt",
    "OcamcalibCamera": "models.ocamcalib",
    "OrthographicCamera": "models.orthographic",
    "PerspectiveCamera": "models.perspective",
    "RadialTableCamera": "models.radial_table",
    "RationalPolynomialCamera": "models.rational_polynomial",
    "StereographicCamera": "models.stereographic",
    "ThinPrismFisheyeCamera": "models.thin_prism_fisheye",
    "UnifiedCamera": "models.unified",
}
__all__ = [
    "CAMERA_MODELS", "CameraSensor", "CentralCamera", "CylindricalCamera", "DivisionCamera",
    "DoubleSphereCamera", "EllipticCamera", "EquidistantCamera", "EquirectangularCamera",
    "EquisolidCamera", "EucmCamera", "FThetaCamera", "FThetaInverseCamera", "GazeboCamera",
    "HyperbolicCamera", "KannalaBrandtCamera", "MirroredCamera", "NonCentralCamera",
    "OcamcalibCamera", "OrthographicCamera", "ParabolicCamera", "ParametricCamera",
    "PerspectiveCamera", "Pixels", "PlanarCamera", "RadialTableCamera",
    "RationalPolynomialCamera", "Rays", "StereographicCamera", "ThinPrismFisheyeCamera",
    "UnifiedCamera", "camera_from_parameters", "check_central", "period_px", "pixel_grid",
    "pixels_of_points", "summary",
]  # fmt: skip

__getattr__ = lazy_names(__name__, _MODULES)
