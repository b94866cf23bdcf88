"""Exact conversions of a lens from one model to another.

All lenses here look along +z; `file_frame` converts mirrors.

| lens | equals | with |
| --- | --- | --- |
| perspective | unified, ξ = 0 | γ = f |
| stereographic | unified, ξ = 1 | γ = 2 f |
| rational polynomial, k4 … τy = 0 | unified, ξ = 0 | and back |
| unified without distortion | EUCM, β = 1; double sphere, ξ = 0 | α = ξ/(1 + ξ), f = γ/(1 + ξ) |
| double sphere, α = 0 | unified | γ = f |
| equidistant | Kannala-Brandt, k = 0 | |
| f-theta, odd powers only | Kannala-Brandt | fx = k1, fy = aspect ratio k1, k_n = coefficients/k1 |
| perspective | OCamCalib | F = −f, c = fy/fx |
| stereographic | OCamCalib | F = ρ²/4f − f |
| the ideal fisheyes | Gazebo's custom function | |

Source: Usenko et al. 2018 (the unified family); Scaramuzza et al. 2006.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import TypeVar

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
    RationalPolynomialCamera,
    StereographicCamera,
    UnifiedCamera,
)
from omnisim.cameras.parametric_camera import FisheyeCamera, FocalCamera

CameraT = TypeVar("CameraT", bound=CentralCamera)
# c1, c2 and fun in r = c1 f fun(θ/c2)
IDEAL_FISHEYES: Mapping[type[FocalCamera], tuple[float, float, str]] = {
    PerspectiveCamera: (1.0, 1.0, "tan"),
    StereographicCamera: (2.0, 2.0, "tan"),
    EquidistantCamera: (1.0, 1.0, "id"),
    EquisolidCamera: (2.0, 2.0, "sin"),
    OrthographicCamera: (1.0, 1.0, "sin"),
}


def equivalent(camera: CentralCamera, model: type[CameraT]) -> CameraT | None:
    """The same lens in another camera model, or None."""
    if isinstance(camera, model) and type(camera) is model:
        return camera
    convert = _CONVERSIONS.get(model)
    converted = convert(camera) if convert else None
    return converted if isinstance(converted, model) else None


def is_plain(camera: UnifiedCamera) -> bool:
    """True for a unified model without distortion or skew."""
    return not any(camera.distortion) and camera.skew_px == 0.0


def _unified(camera: CentralCamera) -> UnifiedCamera | None:
    match camera:
        case UnifiedCamera():
            return camera
        case RationalPolynomialCamera(distortion=distortion, theta_max_rad=math.pi) if not any(
            distortion[5:]
        ):
            return UnifiedCamera(
                camera.width_px, camera.height_px, camera.focal_lengths_px,
                camera.principal_point_px, 0.0, distortion[:5] if distortion[4] else distortion[:4],
            )  # fmt: skip
        case PerspectiveCamera(focal_length_px=focal):
            xi, gammas = 0.0, (focal, focal)
        case StereographicCamera(focal_length_px=focal):
            xi, gammas = 1.0, (2.0 * focal, 2.0 * focal)
        case DoubleSphereCamera(alpha=0.0) if camera.xi >= 0.0:
            xi, gammas = camera.xi, camera.focal_lengths_px
        case EucmCamera(beta=1.0) | EucmCamera(alpha=0.0) | DoubleSphereCamera(xi=0.0) if (
            camera.alpha < 1.0
        ):
            xi = camera.alpha / (1.0 - camera.alpha)
            fx, fy = camera.focal_lengths_px
            gammas = fx / (1.0 - camera.alpha), fy / (1.0 - camera.alpha)
        case _:
            return None
    return UnifiedCamera(camera.width_px, camera.height_px, gammas, camera.principal_point_px, xi)


def _plain_unified(camera: CentralCamera) -> UnifiedCamera | None:
    unified = _unified(camera)
    return unified if unified is not None and is_plain(unified) else None


def _eucm(camera: CentralCamera) -> EucmCamera | None:
    unified = _plain_unified(camera)
    return None if unified is None else EucmCamera(*_alpha_form(unified), beta=1.0)


def _double_sphere(camera: CentralCamera) -> DoubleSphereCamera | None:
    unified = _plain_unified(camera)
    if unified is None:
        return None
    width, height, focal, center, alpha = _alpha_form(unified)
    return DoubleSphereCamera(width, height, focal, center, 0.0, alpha)


def _alpha_form(
    unified: UnifiedCamera,
) -> tuple[int, int, tuple[float, float], tuple[float, float], float]:
    """Size, focal lengths, principal point and α of the model's α form."""
    gamma_u, gamma_v = unified.focal_lengths_px
    scale = 1.0 + unified.xi
    focal = gamma_u / scale, gamma_v / scale
    size = unified.width_px, unified.height_px
    return *size, focal, unified.principal_point_px, unified.xi / scale


def _kannala_brandt(camera: CentralCamera) -> KannalaBrandtCamera | None:
    coefficients: tuple[float, ...] = ()
    if isinstance(camera, EquidistantCamera):
        focals = camera.focal_length_px, camera.focal_length_px
    elif (
        isinstance(camera, FThetaCamera)
        and not any(camera.coefficients_px[1::2])
        and camera.affine == (1.0, 0.0, 0.0)
    ):
        focal, *others = camera.coefficients_px[::2]
        focals = focal, focal * camera.aspect_ratio
        coefficients = tuple(coefficient / focal for coefficient in others)
    else:
        return None
    return KannalaBrandtCamera(
        camera.width_px, camera.height_px, focals, camera.principal_point_px,
        (*coefficients, 0.0, 0.0, 0.0, 0.0)[:4], camera.theta_max_rad,
    )  # fmt: skip


def _f_theta(camera: CentralCamera) -> FThetaCamera | None:
    aspect_ratio = 1.0
    if isinstance(camera, EquidistantCamera):
        coefficients: tuple[float, ...] = (camera.focal_length_px,)
    elif isinstance(camera, KannalaBrandtCamera) and not camera.skew_px:
        fx, fy = camera.focal_lengths_px
        k1, k2, k3, k4 = camera.coefficients
        if k4:
            return None
        aspect_ratio = fy / fx
        coefficients = (fx, 0.0, fx * k1, 0.0, fx * k2, 0.0, fx * k3)
        while coefficients[-1] == 0.0:
            coefficients = coefficients[:-1]
    else:
        return None
    size = camera.width_px, camera.height_px
    return FThetaCamera(
        *size, camera.principal_point_px, coefficients, camera.theta_max_rad, aspect_ratio
    )


def _ocamcalib(camera: CentralCamera) -> OcamcalibCamera | None:
    unified = _plain_unified(camera)
    if unified is None or unified.xi not in (0.0, 1.0):
        return None
    gamma_u, gamma_v = unified.focal_lengths_px
    polynomial = (-gamma_u,) if unified.xi == 0.0 else (-0.5 * gamma_u, 0.0, 0.5 / gamma_u)
    return OcamcalibCamera(
        camera.width_px, camera.height_px, camera.principal_point_px, polynomial,
        (gamma_v / gamma_u, 0.0, 0.0), _theta_max_rad(camera),
    )  # fmt: skip


def _gazebo(camera: CentralCamera) -> GazeboCamera | None:
    if not isinstance(camera, FocalCamera) or type(camera) not in IDEAL_FISHEYES:
        return None
    c1, c2, function = IDEAL_FISHEYES[type(camera)]
    return GazeboCamera(
        camera.width_px, camera.height_px, camera.focal_length_px, camera.principal_point_px,
        c1, c2, 0.0, function, _theta_max_rad(camera),
    )  # fmt: skip


def _theta_max_rad(camera: CentralCamera) -> float:
    return camera.theta_max_rad if isinstance(camera, FisheyeCamera) else math.pi


def _perspective(camera: CentralCamera) -> PerspectiveCamera | None:
    unified = _plain_unified(camera)
    if unified is None or unified.xi:
        return None
    fx, fy = unified.focal_lengths_px
    if fx != fy:
        return None
    return PerspectiveCamera(camera.width_px, camera.height_px, fx, camera.principal_point_px)


def _rational(camera: CentralCamera) -> RationalPolynomialCamera | None:
    unified = _unified(camera)
    if unified is None or unified.xi or unified.skew_px:
        return None
    return RationalPolynomialCamera(
        camera.width_px, camera.height_px, unified.focal_lengths_px, unified.principal_point_px,
        (*unified.distortion[:4], unified.k3, 0.0, 0.0, 0.0),
    )  # fmt: skip


_CONVERSIONS: Mapping[type[CentralCamera], Callable[[CentralCamera], CentralCamera | None]] = {
    UnifiedCamera: _unified, EucmCamera: _eucm, DoubleSphereCamera: _double_sphere,
    KannalaBrandtCamera: _kannala_brandt, FThetaCamera: _f_theta, OcamcalibCamera: _ocamcalib,
    GazeboCamera: _gazebo, PerspectiveCamera: _perspective, RationalPolynomialCamera: _rational,
}  # fmt: skip
