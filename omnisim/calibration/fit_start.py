"""Where a fit begins: for each model the linear problem that is nearest to the fit.

All take the picture as a plane scaled to its axis, with the source's principal point and ratio of
focal lengths, and use the angle θ from +z and the radius r there alone. Where the source is alike
all around its axis and the target can say the same, this is the answer already: the unified
models, for one, have r (α + (1 − α) cos θ) = f sin θ, which is linear in α and f.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from omnisim.cameras import (
    CentralCamera,
    DoubleSphereCamera,
    EquidistantCamera,
    EquisolidCamera,
    EucmCamera,
    FThetaCamera,
    FThetaInverseCamera,
    GazeboCamera,
    KannalaBrandtCamera,
    OcamcalibCamera,
    OrthographicCamera,
    PerspectiveCamera,
    RadialTableCamera,
    StereographicCamera,
    UnifiedCamera,
)
from omnisim.cameras.domain import middle_px
from omnisim.cameras.radial_tangential import RadialTangential
from omnisim.errors import OpticsError

MOST_ALPHA = 0.99  # ξ = 99 for the unified model, where it is told from 1 no more
TABLE_NODES = 48
OCAMCALIB_POWERS = (0, 2, 3, 4, 5, 6)  # a1 = 0: the picture is smooth at the axis


class _Pairs(NamedTuple):
    pixels_px: NDArray[np.float64]  # (n, 2)
    directions: NDArray[np.float64]  # (n, 3), unit, the target's optical frame
    on_area: NDArray[np.bool_]  # (n,): spread evenly over the picture; the others are on its edge


class Samples(_Pairs):
    """Pixels of the source and their rays, in the target's optical frame."""

    @cached_property
    def theta_rad(self) -> NDArray[np.float64]:
        """Angles (n,) of the rays from +z."""
        across = np.hypot(self.directions[:, 0], self.directions[:, 1])
        return np.arctan2(across, self.directions[:, 2])


class Profile(NamedTuple):
    """The source as a lens that is alike all around its axis.

    Attributes:
        size: the picture's width and height in px.
        centre_px: (u, v) of the axis.
        aspect: focal length along v over that along u.
        theta_rad: (n,) angles from +z.
        radii_px: (n,) distances from the axis, in pixels along u.
    """

    size: tuple[int, int]
    centre_px: tuple[float, float]
    aspect: float
    theta_rad: NDArray[np.float64]
    radii_px: NDArray[np.float64]

    def focal_lengths_px(self, focal_px: float) -> tuple[float, float]:
        """Focal lengths along u and v."""
        return focal_px, focal_px * self.aspect


def start_of(
    model: str, camera: CentralCamera, samples: Samples, fixed: Mapping[str, Any]
) -> CentralCamera:
    """The camera of a model that a fit begins with; attributes in `fixed` are as given.

    Raises:
        OpticsError: there is no such camera.
    """
    profile = _profile(camera, samples)
    if len(profile.theta_rad) < 20 or profile.theta_rad.min() > math.radians(170.0):
        raise OpticsError("it shows next to nothing that could be compared")
    fixed = dict(fixed)
    centre_px = fixed.pop("principal_point_px", None)
    if centre_px is not None:
        profile = profile._replace(centre_px=centre_px)
    return _STARTS[model](profile, fixed)


def _profile(camera: CentralCamera, samples: Samples) -> Profile:
    scale = np.broadcast_to(getattr(camera, "pixels_per_plane", 1.0), 2)
    aspect = float(scale[1] / scale[0])
    centre = middle_px(camera)
    offset = (samples.pixels_px - centre) / (1.0, aspect)
    radii = np.hypot(offset[:, 0], offset[:, 1])
    return Profile(
        (camera.width_px, camera.height_px),
        (float(centre[0]), float(centre[1])),
        aspect,
        samples.theta_rad,
        radii,
    )


def _solve(columns: list[NDArray[np.float64]], wanted: NDArray[np.float64]) -> NDArray[np.float64]:
    """Least squares with columns scaled to the same length."""
    matrix = np.stack(columns, axis=-1)
    lengths = np.maximum(np.linalg.norm(matrix, axis=0), 1e-300)
    return np.linalg.lstsq(matrix / lengths, wanted, rcond=None)[0] / lengths


def _alpha_and_focal(profile: Profile) -> tuple[float, float]:
    """α and f of r (α + (1 − α) cos θ) = f sin θ, of the angles that such a model can see."""
    theta, radius = profile.theta_rad, profile.radii_px
    alpha, focal = 0.5, 1.0
    for _ in range(8):
        sine, cosine = np.sin(theta), np.cos(theta)
        alpha, focal = _solve([radius * (1.0 - cosine), -sine], -radius * cosine)
        alpha = float(alpha)
        if abs(alpha) < 1e-12 or abs(alpha - 1.0) < 1e-12:
            alpha = round(alpha)  # rounding, where the model ends
        if not 0.0 <= alpha <= 1.0:
            alpha = min(max(alpha, 0.0), 1.0)
            spread = sine / np.maximum(alpha + (1.0 - alpha) * cosine, 0.1)
            focal = float(radius @ spread / (spread @ spread))
        w = alpha / (1.0 - alpha) if alpha <= 0.5 else (1.0 - alpha) / alpha
        seen = profile.theta_rad < math.acos(-w) + 1e-9
        if seen.sum() < 20 or np.array_equal(profile.theta_rad[seen], theta):
            break
        theta, radius = profile.theta_rad[seen], profile.radii_px[seen]
    return alpha, max(float(focal), 1e-6)


def _perspective_focal(profile: Profile) -> float:
    """f of r cos θ = f sin θ, in front."""
    front = profile.theta_rad < math.radians(80.0)
    if not front.any():
        raise OpticsError("it sees nothing in front")
    sine = np.sin(profile.theta_rad[front])
    radius = profile.radii_px[front] * np.cos(profile.theta_rad[front])
    return max(float(radius @ sine / (sine @ sine)), 1e-6)


def _unified(profile: Profile, fixed: dict[str, Any]) -> CentralCamera:
    xi = fixed.pop("xi", None)
    if xi is None:
        alpha, focal = _alpha_and_focal(profile)
        alpha = min(alpha, MOST_ALPHA)
        xi = alpha / (1.0 - alpha)
        focal *= 1.0 + xi
    elif xi == 0.0:
        return _pinhole(profile, fixed)
    else:
        sine = np.sin(profile.theta_rad) / np.maximum(xi + np.cos(profile.theta_rad), 0.1)
        focal = float(profile.radii_px @ sine / (sine @ sine))
    return UnifiedCamera(
        *profile.size, profile.focal_lengths_px(focal), profile.centre_px, **{"xi": xi, **fixed}
    )


def _pinhole(profile: Profile, fixed: dict[str, Any]) -> CentralCamera:
    """The unified model with ξ = 0: r = f (t + k1 t³ + k2 t⁵), t = tan θ, if that does not fold."""
    focal, distortion = _perspective_focal(profile), (0.0, 0.0, 0.0, 0.0)
    front = profile.theta_rad < math.radians(80.0)
    tangent = np.tan(profile.theta_rad[front])
    first, third, fifth = _solve([tangent, tangent**3, tangent**5], profile.radii_px[front])
    if first > 0.0:
        k1, k2 = float(third / first), float(fifth / first)
        off = profile.radii_px[front] - focal * tangent
        # rounding of a lens without distortion is none
        is_worth_it = np.abs(off).max() > 1e-9 * focal
        if is_worth_it and RadialTangential(k1, k2, 0.0, 0.0).radius_limit(10.0) > tangent.max():
            focal, distortion = float(first), (k1, k2, 0.0, 0.0)
    values = {"xi": 0.0, "distortion": distortion, **fixed}
    return UnifiedCamera(
        *profile.size, profile.focal_lengths_px(focal), profile.centre_px, **values
    )


def _eucm(profile: Profile, fixed: dict[str, Any]) -> CentralCamera:
    alpha, focal = _alpha_and_focal(profile)
    values = {"alpha": alpha, "beta": 1.0, **fixed}
    return EucmCamera(*profile.size, profile.focal_lengths_px(focal), profile.centre_px, **values)


def _double_sphere(profile: Profile, fixed: dict[str, Any]) -> CentralCamera:
    alpha, focal = _alpha_and_focal(profile)
    values = {"xi": 0.0, "alpha": alpha, **fixed}
    return DoubleSphereCamera(
        *profile.size, profile.focal_lengths_px(focal), profile.centre_px, **values
    )


def _kannala_brandt(profile: Profile, fixed: dict[str, Any]) -> CentralCamera:
    theta = profile.theta_rad
    first, *others = _solve([theta**power for power in (1, 3, 5, 7, 9)], profile.radii_px)
    values = {"coefficients": tuple(float(one / first) for one in others), **fixed}
    return KannalaBrandtCamera(
        *profile.size, profile.focal_lengths_px(float(first)), profile.centre_px, **values
    )


def _f_theta(profile: Profile, fixed: dict[str, Any]) -> CentralCamera:
    powers = [profile.theta_rad**power for power in (1, 2, 3, 4)]
    values = {"coefficients_px": tuple(_solve(powers, profile.radii_px).tolist()), **fixed}
    return FThetaCamera(*profile.size, profile.centre_px, **values)


def _f_theta_inverse(profile: Profile, fixed: dict[str, Any]) -> CentralCamera:
    powers = [profile.radii_px**power for power in (1, 2, 3, 4, 5)]
    values = {"coefficients": tuple(_solve(powers, profile.theta_rad).tolist()), **fixed}
    return FThetaInverseCamera(*profile.size, profile.centre_px, **values)


def _ocamcalib(profile: Profile, fixed: dict[str, Any]) -> CentralCamera:
    # F(ρ) sin θ = −ρ cos θ
    sine, cosine = np.sin(profile.theta_rad), np.cos(profile.theta_rad)
    columns = [sine * profile.radii_px**power for power in OCAMCALIB_POWERS]
    a0, *others = _solve(columns, -profile.radii_px * cosine).tolist()
    values = {
        "polynomial": (a0, 0.0, *others),
        "affine": (profile.aspect, 0.0, 0.0),
        **fixed,
    }
    return OcamcalibCamera(*profile.size, profile.centre_px, **values)


def _radial_table(profile: Profile, fixed: dict[str, Any]) -> CentralCamera:
    order = np.argsort(profile.theta_rad)
    theta, radius = profile.theta_rad[order], np.maximum.accumulate(profile.radii_px[order])
    nodes = np.linspace(0.0, min(theta[-1] + 1e-9, math.pi), TABLE_NODES)
    radii = np.interp(nodes, np.append(0.0, theta), np.append(0.0, radius))
    radii += np.arange(TABLE_NODES) * 1e-9 * radii[-1]  # rising, even where the source is not
    values = {
        "thetas_rad": tuple(nodes.tolist()), "radii_px": tuple(radii.tolist()), **fixed
    }  # fmt: skip
    return RadialTableCamera(*profile.size, profile.centre_px, **values)


def _gazebo(profile: Profile, fixed: dict[str, Any]) -> CentralCamera:
    """The best of its three functions, each with the best of some c2, c3 = 0."""
    found: list[tuple[float, GazeboCamera]] = []
    widest = float(profile.theta_rad.max())
    functions = {"sin": np.sin, "tan": np.tan, "id": np.positive}
    wanted = [fixed["function"]] if "function" in fixed else list(functions)
    for function in wanted:
        least = widest / (0.5 * math.pi) if function != "id" else 0.0
        for c2 in (1.0,) if function == "id" else (1.0, 1.5, 2.0, 2.5, 3.0, 4.0):
            if c2 < least or (function == "tan" and c2 * math.radians(89.9) < widest):
                continue
            shape = functions[function](profile.theta_rad / c2)
            focal = float(profile.radii_px @ shape / (shape @ shape)) / c2
            off = float(np.linalg.norm(profile.radii_px - focal * c2 * shape))
            values = {"c1": c2, "c2": c2, "c3": 0.0, "function": function, **fixed}
            found.append((off, GazeboCamera(*profile.size, focal, profile.centre_px, **values)))
    if not found:
        raise OpticsError("none of its functions reaches that far from the axis")
    return min(found, key=lambda one: one[0])[1]


def _perspective(profile: Profile, fixed: dict[str, Any]) -> CentralCamera:
    return PerspectiveCamera(*profile.size, _perspective_focal(profile), profile.centre_px, **fixed)


def _ideal(
    kind: type[Any], shape: Callable[[NDArray[np.float64]], NDArray[np.float64]]
) -> Callable[[Profile, dict[str, Any]], CentralCamera]:
    """The start of a fisheye with r = f · shape(θ)."""

    def start(profile: Profile, fixed: dict[str, Any]) -> CentralCamera:
        limit = kind.largest_theta_rad
        seen = profile.theta_rad <= limit + 1e-9
        if not seen.any():
            raise OpticsError("it sees nothing of what that shows")
        spread = shape(np.minimum(profile.theta_rad[seen], limit))
        focal = float(profile.radii_px[seen] @ spread / (spread @ spread))
        camera: CentralCamera = kind(
            *profile.size, focal, profile.centre_px, **{"theta_max_rad": limit, **fixed}
        )
        return camera

    return start


_STARTS: dict[str, Callable[[Profile, dict[str, Any]], CentralCamera]] = {
    "perspective": _perspective,
    "unified": _unified,
    "eucm": _eucm,
    "double_sphere": _double_sphere,
    "kannala_brandt": _kannala_brandt,
    "f_theta": _f_theta,
    "f_theta_inverse": _f_theta_inverse,
    "ocamcalib": _ocamcalib,
    "radial_table": _radial_table,
    "gazebo": _gazebo,
    "equidistant": _ideal(EquidistantCamera, np.positive),
    "stereographic": _ideal(StereographicCamera, lambda theta: 2.0 * np.tan(0.5 * theta)),
    "equisolid": _ideal(EquisolidCamera, lambda theta: 2.0 * np.sin(0.5 * theta)),
    "orthographic": _ideal(OrthographicCamera, np.sin),
}
