"""Registry of camera models by their names in files."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from omnisim.cameras.camera import CentralCamera
from omnisim.cameras.f_theta_inverse import FThetaInverseCamera
from omnisim.cameras.mirrored import MirroredCamera
from omnisim.cameras.mirrors.elliptic import EllipticCamera
from omnisim.cameras.mirrors.hyperbolic import HyperbolicCamera
from omnisim.cameras.mirrors.parabolic import ParabolicCamera
from omnisim.cameras.mirrors.planar import PlanarCamera
from omnisim.cameras.models.cylindrical import CylindricalCamera
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
from omnisim.cameras.parametric_camera import ParametricCamera
from omnisim.core.errors import OpticsError, did_you_mean

CAMERA_MODELS: dict[str, type[ParametricCamera]] = {
    model.model_name: model
    for model in (
        HyperbolicCamera, PerspectiveCamera, CylindricalCamera, EquidistantCamera,
        StereographicCamera, EquisolidCamera, OrthographicCamera, KannalaBrandtCamera,
        EucmCamera, DoubleSphereCamera, UnifiedCamera, EquirectangularCamera, FThetaCamera,
        FThetaInverseCamera, ParabolicCamera, OcamcalibCamera, RadialTableCamera, GazeboCamera,
        PlanarCamera, EllipticCamera, RationalPolynomialCamera, ThinPrismFisheyeCamera,
        DivisionCamera,
    )
}  # fmt: skip


def camera_from_parameters(parameters: Mapping[str, Any]) -> CentralCamera:
    """Build a camera from its `parameters()`.

    Raises:
        OpticsError: a parameter is invalid; names the key, expected and actual value.
    """
    if not isinstance(parameters, Mapping):  # a damaged file
        raise OpticsError(f"camera: expected its parameters by name, got {parameters!r}")
    model = parameters.get("model")
    if not isinstance(model, str) or model not in CAMERA_MODELS:
        names, hint = ", ".join(CAMERA_MODELS), did_you_mean(str(model), CAMERA_MODELS)
        hint = "" if hint.startswith("expected") else f": {hint}"
        raise OpticsError(f"camera: model: expected one of {names}, got {model!r}{hint}")
    return MirroredCamera.of(CAMERA_MODELS[model].from_parameters(parameters), parameters)
