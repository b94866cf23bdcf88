"""The same lens in another model, exactly, where both can say it.

Everything here is a lens that looks along +z; `file_frame` turns mirrors into such.

| one | is the other | with |
| --- | --- | --- |
| perspective | unified, ξ = 0 | γ = f |
| stereographic | unified, ξ = 1 | γ = 2 f |
| unified without distortion | EUCM, β = 1; double sphere, ξ = 0 | α = ξ/(1 + ξ), f = γ/(1 + ξ) |
| double sphere, α = 0 | unified | γ = f |
| equidistant | Kannala-Brandt, k = 0 | |
| f-theta, odd powers only | Kannala-Brandt | f = k1, k_n = coefficients/k1 |
| perspective | OCamCalib | F = −f, c = fy/fx |
| stereographic | OCamCalib | F = ρ²/4f − f |
| the ideal fisheyes | Gazebo's custom function | |

Source: Usenko et al. 2018 (the unified family); Scaramuzza et al. 2006.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from omnisim.cameras import (
    CentralCamera,
    DoubleSphereCamera,
    EquidistantCamera,
    EquisolidCamera,
    EucmCamera,
    FThetaCamera,
    GazeboCamera,
    KannalaBrandtCamera,
    OcamcalibCamera,
    OrthographicCamera,
    PerspectiveCamera,
    StereographicCamera,
    UnifiedCamera,
)

NO_DISTORTION = (0.0, 0.0, 0.0, 0.0)
# r = c1 f fun(θ/c2)
IDEAL_FISHEYES: dict[type[Any], tuple[float, float, str]] = {
    PerspectiveCamera: (1.0, 1.0, "tan"),
    StereographicCamera: (2.0, 2.0, "tan"),
    EquidistantCamera: (1.0, 1.0, "id"),
    EquisolidCamera: (2.0, 2.0, "sin"),
    OrthographicCamera: (1.0, 1.0, "sin"),
}


def equivalent(camera: CentralCamera, kind: type[CentralCamera]) -> CentralCamera | None:
    """The same lens as a `kind`, or None where that cannot say it."""
    if isinstance(camera, kind) and type(camera) is kind:
        return camera
    convert = _CONVERSIONS.get(kind)
    return convert(camera) if convert else None


def _picture(camera: Any) -> tuple[int, int]:
    return camera.width_px, camera.height_px


def _pair(focal_length_px: float) -> tuple[float, float]:
    return focal_length_px, focal_length_px


def is_plain(camera: UnifiedCamera) -> bool:
    """Whether there is nothing but the sphere: no distortion, no skew."""
    return not any(camera.distortion) and camera.skew_px == 0.0


def _unified(camera: Any) -> UnifiedCamera | None:
    if isinstance(camera, UnifiedCamera):
        return camera
    if isinstance(camera, PerspectiveCamera):
        xi, gammas = 0.0, _pair(camera.focal_length_px)
    elif isinstance(camera, StereographicCamera):
        xi, gammas = 1.0, _pair(2.0 * camera.focal_length_px)
    elif isinstance(camera, DoubleSphereCamera) and camera.alpha == 0.0 and camera.xi >= 0.0:
        xi, gammas = camera.xi, camera.focal_lengths_px
    elif _is_unified_sphere(camera):
        xi = camera.alpha / (1.0 - camera.alpha)
        fx, fy = camera.focal_lengths_px
        gammas = fx / (1.0 - camera.alpha), fy / (1.0 - camera.alpha)
    else:
        return None
    return UnifiedCamera(*_picture(camera), gammas, camera.principal_point_px, xi)


def _is_unified_sphere(camera: Any) -> bool:
    plain_eucm = isinstance(camera, EucmCamera) and (camera.beta == 1.0 or camera.alpha == 0.0)
    one_sphere = isinstance(camera, DoubleSphereCamera) and camera.xi == 0.0
    return (plain_eucm or one_sphere) and camera.alpha < 1.0


def _alpha_form(camera: Any) -> tuple[tuple[float, float], float] | None:
    """Focal lengths and α of a plain unified camera."""
    unified = _unified(camera)
    if unified is None or not is_plain(unified):
        return None
    gamma_u, gamma_v = unified.focal_lengths_px
    grown = 1.0 + unified.xi
    return (gamma_u / grown, gamma_v / grown), unified.xi / grown


def _eucm(camera: Any) -> EucmCamera | None:
    found = _alpha_form(camera)
    if found is None:
        return None
    return EucmCamera(*_picture(camera), found[0], camera.principal_point_px, found[1], beta=1.0)


def _double_sphere(camera: Any) -> DoubleSphereCamera | None:
    found = _alpha_form(camera)
    if found is None:
        return None
    focal, alpha = found
    return DoubleSphereCamera(*_picture(camera), focal, camera.principal_point_px, 0.0, alpha)


def _kannala_brandt(camera: Any) -> KannalaBrandtCamera | None:
    if isinstance(camera, EquidistantCamera):
        focal, coefficients = camera.focal_length_px, NO_DISTORTION
    elif isinstance(camera, FThetaCamera) and not any(camera.coefficients_px[1::2]):
        focal, *others = camera.coefficients_px[::2]
        coefficients = (*(one / focal for one in others), *NO_DISTORTION)[:4]
    else:
        return None
    return KannalaBrandtCamera(
        *_picture(camera),
        _pair(focal),
        camera.principal_point_px,
        coefficients,
        camera.theta_max_rad,
    )


def _f_theta(camera: Any) -> FThetaCamera | None:
    if isinstance(camera, EquidistantCamera):
        coefficients: tuple[float, ...] = (camera.focal_length_px,)
    elif isinstance(camera, KannalaBrandtCamera):
        fx, fy = camera.focal_lengths_px
        k1, k2, k3, k4 = camera.coefficients
        if fx != fy or k4:
            return None
        coefficients = (fx, 0.0, fx * k1, 0.0, fx * k2, 0.0, fx * k3)
        while coefficients[-1] == 0.0:
            coefficients = coefficients[:-1]
    else:
        return None
    return FThetaCamera(
        *_picture(camera), camera.principal_point_px, coefficients, camera.theta_max_rad
    )


def _ocamcalib(camera: Any) -> OcamcalibCamera | None:
    unified = _unified(camera)
    if unified is None or not is_plain(unified):
        return None
    gamma_u, gamma_v = unified.focal_lengths_px
    if unified.xi == 0.0:
        polynomial: tuple[float, ...] = (-gamma_u,)
    elif unified.xi == 1.0:
        polynomial = (-0.5 * gamma_u, 0.0, 0.5 / gamma_u)
    else:
        return None
    return OcamcalibCamera(
        *_picture(camera),
        camera.principal_point_px,
        polynomial,
        (gamma_v / gamma_u, 0.0, 0.0),
        getattr(camera, "theta_max_rad", math.pi),
    )


def _gazebo(camera: Any) -> GazeboCamera | None:
    if type(camera) not in IDEAL_FISHEYES:
        return None
    c1, c2, function = IDEAL_FISHEYES[type(camera)]
    return GazeboCamera(
        *_picture(camera),
        camera.focal_length_px,
        camera.principal_point_px,
        c1,
        c2,
        0.0,
        function,
        getattr(camera, "theta_max_rad", math.pi),
    )


def _perspective(camera: Any) -> PerspectiveCamera | None:
    unified = _unified(camera)
    if unified is None or unified.xi or not is_plain(unified):
        return None
    fx, fy = unified.focal_lengths_px
    if fx != fy:
        return None
    return PerspectiveCamera(*_picture(camera), fx, camera.principal_point_px)


_CONVERSIONS: dict[type[Any], Callable[[Any], CentralCamera | None]] = {
    UnifiedCamera: _unified,
    EucmCamera: _eucm,
    DoubleSphereCamera: _double_sphere,
    KannalaBrandtCamera: _kannala_brandt,
    FThetaCamera: _f_theta,
    OcamcalibCamera: _ocamcalib,
    GazeboCamera: _gazebo,
    PerspectiveCamera: _perspective,
}
