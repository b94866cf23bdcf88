"""Camera models: which ray of the scene each pixel sees.

A model is three files with one stem: `cameras/<model>.py` (NumPy, float64, the reference),
`shaders/camera/<model>.glsl` (the same function for the GPU) and an entry in
`tests/camera_examples.py`, over which one contract test runs; and its name in `cameras/models.py`.
Conventions, for all models:

- Pixels are (u, v), u right and v down, (0, 0) at the centre of the top left one.
- Rays are unit directions in the optical frame (x right, y down, z forward), from the effective
  viewpoint. `omnisim.frames` has all frames.
- A pixel outside the domain, or a direction that the camera cannot see, has `valid` False and
  some finite value; that is data, not an error.
"""

from omnisim.cameras.camera import CentralCamera, Pixels, Rays, pixel_grid
from omnisim.cameras.cylindrical import CylindricalCamera
from omnisim.cameras.double_sphere import DoubleSphereCamera
from omnisim.cameras.elliptic import EllipticCamera
from omnisim.cameras.equidistant import EquidistantCamera
from omnisim.cameras.equirectangular import EquirectangularCamera
from omnisim.cameras.equisolid import EquisolidCamera
from omnisim.cameras.eucm import EucmCamera
from omnisim.cameras.f_theta import FThetaCamera
from omnisim.cameras.f_theta_inverse import FThetaInverseCamera
from omnisim.cameras.gazebo import GazeboCamera
from omnisim.cameras.hyperbolic import HyperbolicCamera
from omnisim.cameras.kannala_brandt import KannalaBrandtCamera
from omnisim.cameras.mirrored import MirroredCamera
from omnisim.cameras.models import CAMERA_MODELS, camera_from_parameters
from omnisim.cameras.ocamcalib import OcamcalibCamera
from omnisim.cameras.orthographic import OrthographicCamera
from omnisim.cameras.parabolic import ParabolicCamera
from omnisim.cameras.perspective import PerspectiveCamera
from omnisim.cameras.planar import PlanarCamera
from omnisim.cameras.radial_table import RadialTableCamera
from omnisim.cameras.stereographic import StereographicCamera
from omnisim.cameras.unified import UnifiedCamera

__all__ = [
    "CAMERA_MODELS",
    "CentralCamera",
    "CylindricalCamera",
    "DoubleSphereCamera",
    "EllipticCamera",
    "EquidistantCamera",
    "EquirectangularCamera",
    "EquisolidCamera",
    "EucmCamera",
    "FThetaCamera",
    "FThetaInverseCamera",
    "GazeboCamera",
    "HyperbolicCamera",
    "KannalaBrandtCamera",
    "MirroredCamera",
    "OcamcalibCamera",
    "OrthographicCamera",
    "ParabolicCamera",
    "PerspectiveCamera",
    "Pixels",
    "PlanarCamera",
    "RadialTableCamera",
    "Rays",
    "StereographicCamera",
    "UnifiedCamera",
    "camera_from_parameters",
    "pixel_grid",
]
