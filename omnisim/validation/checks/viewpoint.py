"""Single viewpoint: rays of the pinhole, reflected by the mirror's normals, meet in one point.

Independent of the camera's shortcut: the ray is intersected with Eq. 1 as a quadric, and reflected
by the gradient of Eq. 1.
"""

from __future__ import annotations

import numpy as np

from omnisim.cameras.mirrors import HyperbolicMirror
from omnisim.core.coordinate_frames import MIRROR_FROM_OPTICAL
from omnisim.plots.style import BLUE, GRAY, ORANGE, Figure, plot
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.report.report import CaptionedFigure, Measure, Section
from omnisim.validation.fixture import Fixture, max_abs, mirror_camera

# The focus property is exact: the error is float64 rounding, which grows with the path.
BOUND_C = 1e-9


def check(fixture: Fixture, title: str) -> Section:
    """Reflect rays over the whole mirror, and measure their distances from the viewpoint."""
    camera = mirror_camera(OmniCamera())
    mirror = camera.mirror
    rim = float(mirror.tangent_from_theta(mirror.theta_max_rad))
    line = np.linspace(-rim, rim, 301)
    grid = np.stack(np.meshgrid(line, line), axis=-1)
    tangents = grid[np.hypot(grid[..., 0], grid[..., 1]) <= rim]
    points, reflected = reflect(mirror, tangents)
    misses = np.linalg.norm(np.cross(points, reflected), axis=-1)
    # the same rays by the camera model, whose optical frame has y and z reversed
    pixels = camera.focal_length_px * tangents * (1.0, -1.0) + camera.principal_point_px
    rays = camera.ray_from_pixel(pixels).directions @ MIRROR_FROM_OPTICAL.T
    angles = 2.0 * np.arcsin(0.5 * np.linalg.norm(rays - reflected, axis=-1))
    return Section(
        title,
        "Rays from the pinhole are intersected with Eq. 1 and reflected by its gradient. Extended "
        "backward, all of them pass through the effective viewpoint. Virtual cameras at this one "
        "point therefore render the mirror's image. The camera model has the same rays.",
        (
            Measure("largest miss of the effective viewpoint", max_abs(misses), "c", BOUND_C),
            Measure("largest angle to the camera model's rays", max_abs(angles), "rad", BOUND_C),
            Measure("rays", misses.size),
        ),
        figures=[CaptionedFigure("single-viewpoint", _figure(mirror),
                 "Section of the mirror. Rays of the scene (orange) point at the effective "
                 "viewpoint, and are reflected into the pinhole (blue).")],
    )  # fmt: skip


def reflect(mirror: HyperbolicMirror, tangents: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points on the mirror (..., 3), in units of c, and unit directions after the reflection.

    Args:
        mirror: mirror; k gives the shape.
        tangents: (..., 2) x and y of the pinhole's rays, which have z = −1.
    """
    shape = 0.5 * mirror.k - 1.0
    pinhole = np.array([0.0, 0.0, 1.0])
    rays = np.concatenate((tangents, -np.ones_like(tangents[..., :1])), axis=-1)
    # Eq. 1 with c = 1 along pinhole + t ray: a t² + b t + d = 0
    a = rays[..., 2] ** 2 - shape * np.sum(tangents**2, axis=-1)
    b = 2.0 * rays[..., 2] * (pinhole[2] - 0.5)
    d = (pinhole[2] - 0.5) ** 2 - 0.25 * (mirror.k - 2.0) / mirror.k
    # the farther of the two sheets, around the other focus, in the form without cancellation
    root = np.sqrt(b * b - 4.0 * a * d)
    t = (-b + root) / (2.0 * a)
    points = pinhole + t[..., None] * rays
    gradient = np.concatenate((-shape * points[..., :2], points[..., 2:] - 0.5), axis=-1)
    normals = gradient / np.linalg.norm(gradient, axis=-1, keepdims=True)
    directions = rays / np.linalg.norm(rays, axis=-1, keepdims=True)
    along = np.sum(directions * normals, axis=-1, keepdims=True)
    return points, directions - 2.0 * along * normals


def _figure(mirror: HyperbolicMirror) -> Figure:
    figure, axes = plot("One effective viewpoint", "r / c", "z / c", 7.0, 6.0)
    rim = float(mirror.tangent_from_theta(mirror.theta_max_rad))
    tangents = np.stack((np.linspace(-rim, rim, 201), np.zeros(201)), axis=-1)
    surface, _ = reflect(mirror, tangents)
    axes.plot(surface[:, 0], surface[:, 2], color="black", linewidth=2.0, label="mirror, Eq. 1")
    points, reflected = reflect(mirror, tangents[4::16])
    for number, (point, away) in enumerate(zip(points, reflected, strict=True)):
        for end, color, width, style, label in (
            (np.array((0.0, 0.0, 1.0)), BLUE, 0.9, "-", "to the pinhole"),
            (point + 0.45 * away, ORANGE, 0.9, "-", "from the scene"),
            (np.zeros(3), GRAY, 0.7, ":", "prolonged"),
        ):
            axes.plot([point[0], end[0]], [point[2], end[2]], style, color=color, linewidth=width,
                      label=label if number == 0 else None)  # fmt: skip
    axes.plot(0.0, 0.0, "o", color=ORANGE, label="effective viewpoint")
    axes.plot(0.0, 1.0, "o", color=BLUE, label="pinhole")
    axes.set_aspect("equal")
    axes.invert_yaxis()  # as mounted: the mirror above, the camera looks up
    axes.legend(loc="lower right", frameon=False)
    return figure
