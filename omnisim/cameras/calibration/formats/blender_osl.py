"""Camera shaders of Blender's Cycles, in Open Shading Language: any central camera but a panorama.

    q = (u − u0, (v − v0)/aspect)/r_max, q' = q + P(q)
    ray = (q' sin θ(|q'|)/|q'|, cos θ(|q'|))

θ is a cubic spline of √(1 − |q'|), in which an image that folds at its rim is smooth. P, two
polynomials of degree 8, undistorts lenses that are not symmetric about the axis; others have none.
A comment and a note state the residual; Cycles' 32-bit floats add some 1e-4 px. The text ends with
the camera's parameters, which are read.

Blender's camera has the type Custom, from version 4.5 on, and the image the camera's size.

Source: Blender's manual, Cycles, "Custom Camera".
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from omnisim.cameras import (
    CAMERA_MODELS,
    CentralCamera,
    CylindricalCamera,
    EquirectangularCamera,
    camera_from_parameters,
)
from omnisim.cameras.calibration import documents
from omnisim.cameras.calibration.fit import samples_of
from omnisim.cameras.calibration.formats import format as base
from omnisim.cameras.calibration.formats.format import Format, ParsedCamera, error_context
from omnisim.cameras.models.field_of_view import angles_from_axis, optical_axis
from omnisim.cameras.parametric_camera import PlaneCamera, unit_vectors
from omnisim.core.arrays import Bools, Floats
from omnisim.core.errors import CalibrationError

NODES, AZIMUTHS, DEGREE = 257, 8, 8
GRID = 65  # pixels per side, at which residuals are measured
HALVINGS = 50  # to the last bit of an angle
MARGIN = 1e-6  # of the radius: rounding of Cycles' floats at the rim
SYMMETRIC_PX = 1e-4  # residual below which the spline alone is enough
MAX_RESIDUAL = 0.02  # share of the image's shorter side, as for fits
MAX_MISSED = 0.01  # share of the pixels whose validity may differ
_PARAMETERS = re.compile(r"^// omnisim's camera: (.*)$", re.M)


class Expansion(NamedTuple):
    """Rays of a lens that is nearly symmetric about its axis."""

    center_px: tuple[float, float]
    aspect: float  # pixels along v per pixel along u, at the same angle
    sign: float  # of the direction across the axis: −1 if the image is upside down
    axis: float  # sign of z
    radius_px: float  # where the domain, or the image, ends
    spline: Floats  # (4, NODES − 1) coefficients, highest power first, per interval's width
    polynomial: Floats  # (n, 2) coefficients of P, or none

    def rays(self, pixels: Floats) -> tuple[Floats, Bools]:
        """Directions (..., 3) of pixels (..., 2), optical frame, and their validity (...,)."""
        offset = (pixels - self.center_px) / (self.radius_px, self.aspect * self.radius_px)
        if len(self.polynomial):
            offset = offset + _powers(offset) @ self.polynomial
        radius = np.hypot(offset[..., 0], offset[..., 1])
        at = (1.0 - np.sqrt(np.maximum(1.0 - radius, 0.0))) * (NODES - 1)
        interval = np.minimum(at.astype(np.int64), NODES - 2)
        t, (c3, c2, c1, c0) = at - interval, self.spline[:, interval]
        theta = ((c3 * t + c2) * t + c1) * t + c0
        across = self.sign * unit_vectors(offset, radius) * np.sin(theta)[..., None]
        directions = np.concatenate((across, self.axis * np.cos(theta)[..., None]), axis=-1)
        return directions, radius <= 1.0 + MARGIN


def _powers(offset: Floats) -> Floats:
    """Products (..., n) of the powers of x and y, in the shader's order."""
    x, y = offset[..., 0], offset[..., 1]
    pairs = [(i, j) for i in range(DEGREE + 1) for j in range(DEGREE + 1 - i)]
    return np.stack([x**i * y**j for i, j in pairs], axis=-1)


@lru_cache(maxsize=4)  # for the text and for the note
def expansion(camera: CentralCamera) -> tuple[Expansion, float]:
    """Expansion of a camera's rays, and its largest residual in pixels.

    Raises:
        CalibrationError: the residual is too large, or no pixel is valid.
    """
    from scipy.interpolate import CubicSpline  # slow to import

    scale = camera.pixels_per_plane if isinstance(camera, PlaneCamera) else 1.0
    aspect = scale[1] / scale[0] if isinstance(scale, tuple) else 1.0
    center, axis = camera.principal_point_px, optical_axis(camera)
    beside = camera.ray_from_pixel(np.add(center, (0.25, 0.0))).directions
    sign = -1.0 if beside[0] < 0.0 else 1.0
    samples = samples_of(camera, False)  # with those at the edge
    if not len(samples.pixels_px):
        raise CalibrationError("camera: no pixel of this camera has a ray")
    angles = angles_from_axis(samples.directions, axis)
    end = float(angles.max())

    def radii_px(theta: Floats) -> Floats:
        """Mean distances (n,) from the axis, of the pixels at angles (n,)."""
        azimuth = np.linspace(0.0, math.tau, AZIMUTHS, endpoint=False)
        circle = np.stack((np.cos(azimuth), np.sin(azimuth)), axis=-1)
        across = sign * np.sin(theta)[:, None, None] * circle
        along = np.broadcast_to(axis * np.cos(theta)[:, None, None], (*across.shape[:2], 1))
        seen = camera.pixel_from_ray(np.concatenate((across, along), axis=-1))
        offset = (seen.positions_px - center) / (1.0, aspect)
        lengths = np.where(seen.valid, np.hypot(offset[..., 0], offset[..., 1]), 0.0)
        return np.asarray(lengths.sum(axis=1) / np.maximum(seen.valid.sum(axis=1), 1))

    nodes = 1.0 - (1.0 - np.linspace(0.0, 1.0, NODES)) ** 2  # dense where the image may fold
    radius = float(radii_px(np.array([end]))[0])
    low, high = np.zeros(NODES), np.full(NODES, end)
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        below = radii_px(middle) < nodes * radius
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    theta = np.concatenate(([0.0], 0.5 * (low + high)[1:-1], [end]))
    spline = CubicSpline(np.arange(NODES), theta).c
    found = Expansion(center, aspect, sign, axis, radius, spline, np.zeros((0, 2)))
    residual_px, missed = _residual_px(camera, found)
    if residual_px > SYMMETRIC_PX:
        directions = samples.directions * (sign, sign, 1.0)
        lengths = np.hypot(directions[:, 0], directions[:, 1])
        expected = unit_vectors(directions[:, :2], lengths) * radii_px(angles)[:, None] / radius
        offset = (samples.pixels_px - center) / (radius, aspect * radius)
        fitted = np.linalg.lstsq(_powers(offset), expected - offset, rcond=None)[0]
        found = found._replace(polynomial=np.asarray(fitted, dtype=np.float64))
        residual_px, missed = _residual_px(camera, found)
    most_px = MAX_RESIDUAL * min(camera.width_px, camera.height_px)
    if not (residual_px <= most_px and missed <= MAX_MISSED):
        raise CalibrationError(
            f"camera: blender_osl cannot represent model {camera.model_name!r}: the nearest is up "
            f"to {residual_px:.3g} px off, with {100.0 * missed:.2g} % of its pixels black or not "
            "by mistake"
        )
    return found, residual_px


def _residual_px(camera: CentralCamera, found: Expansion) -> tuple[float, float]:
    """Largest distance from the pixel of a ray, and the share of pixels that differ in validity."""
    u, v = (np.rint(np.linspace(0.0, n - 1.0, GRID)) for n in (camera.width_px, camera.height_px))
    pixels = np.stack(np.meshgrid(u, v), axis=-1)
    directions, valid = found.rays(pixels)
    seen = camera.pixel_from_ray(directions)
    expected = camera.ray_from_pixel(pixels).valid
    both = expected & valid & seen.valid
    off_px = np.linalg.norm(seen.positions_px - pixels, axis=-1)
    missed = float(np.mean(expected != valid))
    return (float(off_px[both].max()) if both.any() else math.inf), missed


class BlenderOsl(Format[CentralCamera]):
    """Format of a camera shader of Cycles."""

    name = "blender_osl"
    title = "Blender: Cycles camera in OSL"
    suffix = ".osl"
    models = tuple(
        model
        for model in CAMERA_MODELS.values()
        if model not in (CylindricalCamera, EquirectangularCamera)
    )
    fits = ()
    signature = _PARAMETERS
    metadata_place = base.MetadataPlace.SLASHES

    def read(self, document: Any, source: str) -> list[ParsedCamera[CentralCamera]]:
        """Parse the parameters in the last comment."""
        found = _PARAMETERS.search(document)
        if found is None:
            raise CalibrationError(f"{source}: expected a camera shader that omnisim wrote")
        entry = documents.parse_json(found[1], source)
        with error_context(source):
            camera = camera_from_parameters(entry.get("camera", {}))
        return [ParsedCamera(str(entry.get("name", "camera")), camera)]

    def encode(self, cameras: Sequence[ParsedCamera[CentralCamera]]) -> str:
        """Text of the shader of a camera."""
        (camera,) = cameras
        found, residual_px = expansion(camera.lens)
        entry = json.dumps({"name": camera.name, "camera": camera.lens.parameters()})
        return _shader(camera.lens, found, residual_px) + f"// omnisim's camera: {entry}\n"

    def native(self, camera: CentralCamera) -> CentralCamera | None:
        """The camera itself, unless it is a panorama: Blender has those."""
        return None if isinstance(camera, CylindricalCamera | EquirectangularCamera) else camera

    def unsupported(self, lens: CentralCamera) -> None:
        """None, because the shader represents every lens."""

    def lens_caveats(self, lens: CentralCamera) -> tuple[str, ...]:
        """Note on the residual of the shader's rays."""
        return (f"the shader's rays are up to {expansion(lens)[1]:.2g} px off",)


def _array(name: str, values: Floats) -> str:
    numbers = ", ".join(f"{value:.9g}" for value in values.tolist())
    return f"    float {name}[{len(values)}] = {{{numbers}}};\n"


def _shader(camera: CentralCamera, found: Expansion, residual_px: float) -> str:
    width, height = camera.width_px, camera.height_px
    (u, v), radius = found.center_px, found.radius_px
    correction = "" if not len(found.polynomial) else f"""
    // undistorted: what is not symmetric about the axis
{_array("px", found.polynomial[:, 0])}{_array("py", found.polynomial[:, 1])}
    int term = 0;
    float power_x = 1.0;
    float dx = 0.0, dy = 0.0;
    for (int i = 0; i <= {DEGREE}; i++) {{
        float power = power_x;
        for (int j = 0; i + j <= {DEGREE}; j++) {{
            dx += px[term] * power;
            dy += py[term] * power;
            power *= y;
            term++;
        }}
        power_x *= x;
    }}
    x += dx;
    y += dy;
"""  # fmt: skip
    arrays = "".join(_array(f"c{3 - row}", terms) for row, terms in enumerate(found.spline))
    return f"""// omnisim's {camera.model_name} as a camera of the type Custom in Blender's Cycles.
// Render {width} x {height} px. Rays are up to {residual_px:.2g} px off.
shader omnisim_camera(
    output point position = 0.0, output vector direction = 0.0, output color throughput = 1.0)
{{
    point raster = camera_shader_raster_position();
    float x = (raster[0] * {width} - {u + 0.5!r}) / {radius!r};
    float y = ((1.0 - raster[1]) * {height} - {v + 0.5!r}) / {found.aspect * radius!r};
{correction}
    // the angle from the axis, by the radius: a cubic spline
{arrays}
    float radius = sqrt(x * x + y * y);
    float at = (1.0 - sqrt(max(1.0 - radius, 0.0))) * {NODES - 1};
    int k = clamp(int(at), 0, {NODES - 2});
    float t = at - k;
    float theta = ((c3[k] * t + c2[k]) * t + c1[k]) * t + c0[k];
    float spread = radius > 0.0 ? {found.sign!r} * sin(theta) / radius : 0.0;
    direction = vector(spread * x, -spread * y, {found.axis!r} * cos(theta));
    if (radius > {1.0 + MARGIN!r})
        throughput = 0.0;
}}
"""
