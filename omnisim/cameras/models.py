"""Registry of the camera models, by name, and cameras from their parameters."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from omnisim.cameras.camera import CentralCamera
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
from omnisim.cameras.ocamcalib import OcamcalibCamera
from omnisim.cameras.orthographic import OrthographicCamera
from omnisim.cameras.parabolic import ParabolicCamera
from omnisim.cameras.parametric_camera import ParametricCamera
from omnisim.cameras.perspective import PerspectiveCamera
from omnisim.cameras.planar import PlanarCamera
from omnisim.cameras.radial_table import RadialTableCamera
from omnisim.cameras.stereographic import StereographicCamera
from omnisim.cameras.unified import UnifiedCamera
from omnisim.errors import OpticsError

CAMERA_MODELS: dict[str, type[ParametricCamera]] = {
    kind.model_name: kind
    for kind in (
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
    )
}


def camera_from_parameters(parameters: Mapping[str, Any]) -> CentralCamera:
    """Camera that a camera's `parameters()` describes.

    Raises:
        OpticsError: an unknown model, or naming the key and what was wanted.
    """
    model = parameters.get("model")
    if not isinstance(model, str) or model not in CAMERA_MODELS:
        names = ", ".join(CAMERA_MODELS)
        raise OpticsError(f"camera: model: expected one of {names}, got {model!r}")
    return MirroredCamera.of(CAMERA_MODELS[model].from_parameters(parameters), parameters)
