"""Cameras of a stage: start poses and lenses."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pxr import Usd

from omnisim.cameras import (
    CentralCamera,
    FThetaInverseCamera,
    KannalaBrandtCamera,
    RationalPolynomialCamera,
)
from omnisim.scene.formats.cameras import pinhole
from omnisim.scene.parts import StartPose

_LEVEL = 1e-6  # minimum horizontal part of a viewing direction that has a heading


def start_of_camera(world_from_camera: NDArray[np.float64]) -> StartPose | None:
    """Start pose from a camera's position and heading; None: an invalid pose.

    Source: UsdGeomCamera looks along −z, with y up.
    """
    position, ahead = world_from_camera[:3, 3], -world_from_camera[:3, 2]
    if not np.isfinite(world_from_camera).all():
        return None
    if np.hypot(*ahead[:2]) < _LEVEL * np.linalg.norm(ahead):
        ahead = world_from_camera[:3, 1] * -np.sign(ahead[2])  # the top of the image
    x, y, z = position.tolist()
    yaw_deg = math.degrees(math.atan2(ahead[1], ahead[0]))
    return StartPose((x, y, z), round(yaw_deg, 6) + 0.0)  # avoids -0.0


def lens_of(prim: Usd.Prim, time: Usd.TimeCode) -> CentralCamera | str:
    """Lens of a camera, or the reason why omnisim has none.

    NVIDIA's optical centers count pixels from the corner of the first pixel, like its image sizes.

    Source: UsdGeomCamera; NVIDIA's schemas OmniLensDistortion…API, and the older attributes
    `cameraProjectionType` and `fthetaPolyA` to `fthetaPolyE`.
    """

    def value(name: str) -> Any:
        attribute = prim.GetAttribute(name)
        return attribute.Get(time) if attribute else None

    def values(prefix: str, *keys: str) -> list[float]:
        return [float(value(f"{prefix}{key}") or 0.0) for key in keys]

    older = str(value("cameraProjectionType") or "pinhole")
    model = str(value("omni:lensdistortion:model") or ("" if older == "pinhole" else older))
    prefix = f"omni:lensdistortion:{model}:"
    if not model:
        across, down, focal = values("", "horizontalAperture", "verticalAperture", "focalLength")
        right, up = values("", "horizontalApertureOffset", "verticalApertureOffset")
        if value("projection") == "orthographic":
            return "it is orthographic"
        return pinhole((across, down), focal, (right, up))
    if model in ("opencvPinhole", "opencvFisheye"):
        width, height = map(int, value(f"{prefix}imageSize") or (2048, 1024))
        fx, fy, u, v = values(prefix, "fx", "fy", "cx", "cy")
        keys = "k1 k2 k3 k4" if model == "opencvFisheye" else "k1 k2 p1 p2 k3 k4 k5 k6 s1 s2 s3 s4"
        make = KannalaBrandtCamera if model == "opencvFisheye" else RationalPolynomialCamera
        coefficients = tuple(values(prefix, *keys.split()))
        return make(width, height, (fx, fy), (u - 0.5, v - 0.5), coefficients)
    if model in ("ftheta", "kannalaBrandtK3"):
        width, height = map(int, values(prefix, "nominalWidth", "nominalHeight"))
        u, v = map(float, value(f"{prefix}opticalCenter") or (0.5 * width, 0.5 * height))
        (field_deg,) = values(prefix, "maxFov")
        k = values(prefix, "k0", "k1", "k2", "k3", "k4")
    elif model == "fisheyePolynomial":
        width, height = map(int, values("ftheta", "Width", "Height"))
        u, v, field_deg = values("ftheta", "Cx", "Cy", "MaxFov")
        k = values("fthetaPoly", "A", "B", "C", "D", "E")
    else:
        return f"omnisim has no model {model}"
    center, theta_max_rad = (u - 0.5, v - 0.5), math.radians(0.5 * field_deg) or math.pi
    if model == "kannalaBrandtK3":
        shares = (k[1] / k[0], k[2] / k[0], k[3] / k[0], 0.0)
        return KannalaBrandtCamera(width, height, (k[0], k[0]), center, shares, theta_max_rad)
    if k[0]:
        return f"omnisim has no f-theta lens with k0 = {k[0]:g}"
    return FThetaInverseCamera(width, height, center, tuple(k[1:]), theta_max_rad)
