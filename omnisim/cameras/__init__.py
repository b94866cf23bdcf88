"""Camera models: map pixels to viewing rays, and rays to pixels.

Each model has two files of the same stem: `cameras/models/<model>.py` or
`cameras/mirrors/<model>.py` (NumPy, float64, the reference) and
`shaders/camera/<model>.glsl` (the same function on the GPU). It also has its class in this file and
an entry in `tests/camera_examples.py`, on which one contract test runs.
All models share these conventions:

- Pixels are (u, v), u right and v down, (0, 0) at the center of the top left pixel.
- Rays are unit directions in the optical frame (x right, y down, z forward), from the effective
  viewpoint. `omnisim.core.coordinate_frames` lists all frames.
- For a pixel outside the domain, or a direction that the camera cannot see, `valid` is False and
  the value is finite but meaningless; this is data, not an error.
"""

from collections.abc import Mapping
from typing import Any

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
from omnisim.cameras.f_theta_inverse import FThetaInverseCamera
from omnisim.cameras.full_turn import period_px
from omnisim.cameras.mirrored import MirroredCamera
from omnisim.cameras.mirrors.elliptic import EllipticCamera
from omnisim.cameras.mirrors.hyperbolic import HyperbolicCamera
from omnisim.cameras.mirrors.parabolic import ParabolicCamera
from omnisim.cameras.mirrors.planar import PlanarCamera
from omnisim.cameras.models.cylindrical import CylindricalCamera
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
from omnisim.cameras.models.unified import UnifiedCamera
from omnisim.cameras.parametric_camera import ParametricCamera
from omnisim.core.errors import OpticsError

__all__ = [
    "CAMERA_MODELS",
    "CameraSensor",
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
    "NonCentralCamera",
    "OcamcalibCamera",
    "OrthographicCamera",
    "ParabolicCamera",
    "ParametricCamera",
    "PerspectiveCamera",
    "Pixels",
    "PlanarCamera",
    "RadialTableCamera",
    "RationalPolynomialCamera",
    "Rays",
    "StereographicCamera",
    "UnifiedCamera",
    "camera_from_parameters",
    "check_central",
    "period_px",
    "pixel_grid",
    "pixels_of_points",
    "summary",
]

CAMERA_MODELS: dict[str, type[ParametricCamera]] = {
    model.model_name: model
    for model in (
        HyperbolicCamera,
        PerspectiveCamera,
        CylindricalCamera,
        EquidistantCamera,
        StereographicCamera,
        EquisolidCamera,
        OrthographicCamera,
        KannalaBrandtCamera,
        EucmCamera,
        DoubleSphereCamera,
        UnifiedCamera,
        EquirectangularCamera,
        FThetaCamera,
        FThetaInverseCamera,
        ParabolicCamera,
        OcamcalibCamera,
        RadialTableCamera,
        GazeboCamera,
        PlanarCamera,
        EllipticCamera,
        RationalPolynomialCamera,
    )
}


def camera_from_parameters(parameters: Mapping[str, Any]) -> CentralCamera:
    """Build a camera from its `parameters()`.

    Raises:
        OpticsError: a parameter is invalid; names the key, the actual and the expected value.
    """
    if not isinstance(parameters, Mapping):  # a damaged file
        raise OpticsError(f"camera: expected its parameters by name, got {parameters!r}")
    model = parameters.get("model")
    if not isinstance(model, str) or model not in CAMERA_MODELS:
        names = ", ".join(CAMERA_MODELS)
        raise OpticsError(f"camera: model: expected one of {names}, got {model!r}")
    return MirroredCamera.of(CAMERA_MODELS[model].from_parameters(parameters), parameters)
