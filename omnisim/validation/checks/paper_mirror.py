"""The paper's mirror: Fig. 7 to 9, Eq. 2 and the single viewpoint."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from omnisim.cameras import HyperbolicCamera, pixel_grid
from omnisim.cameras.mirrors import HyperbolicMirror
from omnisim.cameras.mirrors.hyperbolic import image_radius_eq2_px
from omnisim.cameras.mirrors.mirror_mesh import PAPER_POLYGON_COUNTS
from omnisim.core.arrays import Bytes, Floats
from omnisim.core.bilinear import sample
from omnisim.core.coordinate_frames import MIRROR_FROM_OPTICAL
from omnisim.ground_truth.frame import Frame
from omnisim.plots.style import BLUE, GRAY, ORANGE, RED, Figure, gallery, plot
from omnisim.rendering.camera.omnicamera import PAPER_POLYGONS, OmniCamera
from omnisim.rendering.camera.quality import MAX_ERROR_PX
from omnisim.rendering.opengl.capture.mesh_and_lens import PixelMap
from omnisim.rendering.opengl.gl.context import open_context
from omnisim.rendering.stage import Stage
from omnisim.report.report import CaptionedFigure, Measure, ResultTable, Section
from omnisim.scene import Scene, load_scene
from omnisim.validation.fixture import Fixture, linear_image, max_abs, mirror_camera
from omnisim.validation.image_differences import psnr_db

STEP_DEG = 5
WIDE_RIM_DEG = 130.0
# The remaining error of an exact image is its sampling, below the stated 0.05 px.
EXACT_BOUND_PX = 0.05
MESH_BOUND_PX = 0.3
STEP_PX = 0.1  # along a radius


class Rings(NamedTuple):
    """Radii measured in one image."""

    angles_deg: Floats  # (n,) incidence
    radii_px: Floats  # (n, azimuths) measured
    exact_px: Floats  # (n,) by the exact relation
    eq2_px: Floats  # (n,) by Eq. 2, with the 90° circle of the exact relation

    @property
    def mean_error_px(self) -> Floats:
        """Means (n,) over azimuths of measured minus exact radii."""
        return self.radii_px.mean(axis=1) - self.exact_px

    def sector_error_px(self, sectors: int = 24) -> float:
        """Maximum error of a ring's mean radius in a sector."""
        in_sectors = self.radii_px.reshape(len(self.radii_px), sectors, -1).mean(axis=2)
        return max_abs(in_sectors - self.exact_px[:, None])


def check_rings(fixture: Fixture, title: str) -> Section:
    """Render the rings exactly and with 1024 polygons, and measure all radii."""
    scene = load_scene("rings")
    paper = OmniCamera(polygons=PAPER_POLYGONS)
    exact = render(fixture, scene, paper.with_polygons(None))
    mesh = render(fixture, scene, paper)
    table = {"mirror": {"theta_max_deg": WIDE_RIM_DEG, "polygons": "exact"}}
    wide_sensor = OmniCamera.from_table(table).resized(1024)
    wide_frame = render(fixture, scene, wide_sensor)
    camera = mirror_camera(paper)
    rings, by_mesh = measure(exact, camera), measure(mesh, camera)
    wide = measure(wide_frame, mirror_camera(wide_sensor))
    eq2_off = wide.radii_px.mean(axis=1) - wide.eq2_px
    relative = 100.0 * (wide.eq2_px / wide.exact_px - 1.0)
    large = render(fixture, scene, OmniCamera().with_polygons(None).resized(720))
    columns = (
        rings.angles_deg, rings.exact_px, rings.mean_error_px, by_mesh.mean_error_px, rings.eq2_px
    )  # fmt: skip
    rows = tuple(
        (
            f"{angle:.0f}°",
            *(f"{px:.3f}" for px in (radius, radius + off_exact, radius + off_mesh, eq2)),
            *(f"{px:+.3f}" for px in (off_exact, off_mesh, eq2 - radius)),
        )
        for angle, radius, off_exact, off_mesh, eq2 in zip(*columns, strict=True)
    )
    return Section(
        title,
        "Radii of rings at every 5° of incidence, as in Fig. 7, measured at 720 azimuths. They "
        "agree with the exact relation, r = f ψ sin θ/(ξ + cos θ). The paper's Eq. 2, "
        "r = h sin θ/(1 + cos θ), is the special case ξ = 1, a paraboloid; this mirror has "
        f"ξ = {camera.mirror.xi:.5f}. With the same 90° circle, Eq. 2 has an error of "
        f"{relative[2]:+.2f} % at 15°, {relative[21]:+.2f} % at 110° and {relative[24]:+.2f} % at "
        f"125°. The latter is {abs(eq2_off[24]):.1f} px in an image of 1024 px, far more than the "
        "error of the measurement.",
        (
            Measure("exact capture, 360 px: each ring's mean radius against the exact relation",
                    max_abs(rings.mean_error_px), "px", EXACT_BOUND_PX),
            Measure("exact capture, 360 px: mean radius in any sector of 15°",
                    rings.sector_error_px(), "px", 3.0 * EXACT_BOUND_PX),
            Measure("1024 polygons, 360 px: each ring's mean radius against the exact relation",
                    max_abs(by_mesh.mean_error_px), "px", MESH_BOUND_PX),
            Measure("1024 polygons, 360 px: mean radius in any sector of 15°",
                    by_mesh.sector_error_px(), "px", MESH_BOUND_PX),
            Measure("rim at 130°, exact capture, 1024 px: each ring's mean radius",
                    max_abs(wide.mean_error_px), "px", EXACT_BOUND_PX),
            Measure("ξ", camera.mirror.xi),
        ),
        (ResultTable("Radii in pixels of a 360 × 360 image, and their differences from the exact "
                     "relation",
                     ("θ", "exact relation", "measured, exact capture", "measured, 1024 polygons",
                      "Eq. 2", "exact capture −", "1024 polygons −", "Eq. 2 −"), rows),),
        (
            CaptionedFigure("fig7-rings", gallery({"": large.rgb}, 1, side_in=6.5),
                    "Lines of equal incidence, 5° apart, in the exact mirror; 90° is red."),
            CaptionedFigure("fig7-radii", _figure(wide, rings, by_mesh),
                    "Measured radii (dots) and Eq. 2 (line), minus the exact relation."),
        ),
    )  # fmt: skip


def render(fixture: Fixture, scene: Scene, sensor: OmniCamera) -> Frame:
    """Image of the rings from their center."""
    return fixture.render(scene, sensor, sensor.base_pose(scene.start.position_m))


def measure(frame: Frame, camera: HyperbolicCamera) -> Rings:
    """Measure all rings that are more than 1° inside the rim."""
    # white is 1; the lines are dark in green, also the red one
    green = linear_image(frame)[..., 1].astype(np.float64)
    darkness = np.where(frame.valid, 1.0 - green, 0.0)
    angles_deg = np.arange(STEP_DEG, math.degrees(camera.mirror.theta_max_rad) - 1.0, STEP_DEG)
    exact_px = exact_radius_px(camera, angles_deg)
    between_px = exact_radius_px(camera, angles_deg - 0.5 * STEP_DEG)
    radii = [
        ring_radii(darkness, camera.principal_point_px, radius, radius - between)
        for radius, between in zip(exact_px, between_px, strict=True)
    ]
    horizon_px = float(exact_radius_px(camera, np.array([90.0]))[0])
    eq2_px = image_radius_eq2_px(np.radians(angles_deg), horizon_px)
    return Rings(angles_deg.astype(np.float64), np.stack(radii), exact_px, eq2_px)


def exact_radius_px(camera: HyperbolicCamera, angles_deg: Floats) -> Floats:
    """Image radii (n,) by the unified model's relation, r = f ψ sin θ/(ξ + cos θ).

    From k and the focal length only, as the camera's own code is under test.
    """
    k, theta = camera.mirror.k, np.radians(angles_deg)
    xi, psi = math.sqrt(k * (k - 2.0)) / (k - 1.0), 1.0 / (k - 1.0)
    return camera.focal_length_px * psi * np.sin(theta) / (xi + np.cos(theta))


def _figure(wide: Rings, exact: Rings, mesh: Rings) -> Figure:
    figure, axes = plot(
        "Radii of the rings minus the exact relation (ξ = 0.99549)",
        "incidence θ in degrees",
        "difference in % of the 90° circle's radius",
    )

    def percent(radii_px: Floats, rings: Rings) -> Floats:
        horizon_px = rings.exact_px[rings.angles_deg == 90.0]
        share: Floats = (radii_px - rings.exact_px) / horizon_px
        return 100.0 * share

    axes.axhline(0.0, color=GRAY, linewidth=1.0)
    axes.axvline(90.0, color=RED, linewidth=0.8, linestyle=":")
    axes.plot(wide.angles_deg, percent(wide.eq2_px, wide), color=ORANGE, label="Eq. 2 (ξ = 1)")
    for rings, mark, color, label in (
        (wide, "o", BLUE, "exact capture, 1024 px"),
        (exact, ".", "black", "exact capture, 360 px"),
        (mesh, "x", GRAY, "1024 polygons, 360 px"),
    ):
        mean = percent(rings.radii_px.mean(axis=1), rings)
        axes.plot(rings.angles_deg, mean, mark, color=color, label=f"measured, {label}")
    axes.legend(loc="lower left", frameon=False)
    return figure


def ring_radii(
    darkness: Floats,
    center_px: tuple[float, float],
    expected_px: float,
    reach_px: float,
    azimuths: int = 720,
) -> Floats:
    """Radii (azimuths,) of one dark ring at evenly spaced azimuths.

    The radius at an azimuth is the centroid of the darkness along that azimuth, within `reach_px`
    of the expected radius. Blur makes a ring's radial profile proportional to 1/√r; the centroid
    therefore weights darkness by √r.

    Args:
        darkness: image (height, width), 0 without a ring.
        center_px: (u, v) center of the rings.
        expected_px, reach_px: center and half width of the search interval, which must contain no
            other ring.
        azimuths: number of azimuths.
    """
    angles = 2.0 * np.pi * (np.arange(azimuths) + 0.5) / azimuths
    radii = expected_px + np.arange(-reach_px, reach_px + 0.5 * STEP_PX, STEP_PX)
    radii = radii[radii > 0.0]
    directions = np.stack((np.cos(angles), np.sin(angles)), axis=-1)
    profile = sample(darkness, directions[:, None] * radii[:, None] + np.asarray(center_px))
    weights = profile * np.sqrt(radii)
    return (weights * radii).sum(axis=1) / weights.sum(axis=1)


# Fig. 8 and 9: error of the mirror's mesh by the number of polygons.


DEFAULT_SIZES_PX = (360, 1024)
DETAIL = (slice(4, 64), slice(140, 224))  # rows and columns of the 360 px image


class MeshResult(NamedTuple):
    """Errors of one mesh's image."""

    error_px: Floats  # (pixels,) between mesh and mirror
    psnr_db: float  # against the exact capture, where both show the scene
    image: Bytes


def check_polygons(fixture: Fixture, title: str) -> Section:
    """Render the textured scene by meshes of 16 to 4096 polygons and exactly."""
    sensor = OmniCamera()
    pose = sensor.base_pose(fixture.viewpoint_m)
    with Stage(fixture.scene, device=fixture.device) as stage:
        exact, *frames = (
            fixture.render(stage, sensor.with_polygons(polygons), pose)
            for polygons in (None, *PAPER_POLYGON_COUNTS)
        )
    results = {}
    for polygons, frame in zip(PAPER_POLYGON_COUNTS, frames, strict=True):
        error = shown_error_px(fixture, sensor.with_polygons(polygons))
        psnr = psnr_db(linear_image(frame), linear_image(exact), frame.valid & exact.valid)
        results[polygons] = MeshResult(error, psnr, frame.rgb)
    means = [results[polygons].error_px.mean() for polygons in PAPER_POLYGON_COUNTS]
    slope = float(np.polyfit(np.log(PAPER_POLYGON_COUNTS), np.log(means), 1)[0])
    paper = results[PAPER_POLYGONS]
    counts = np.array(PAPER_POLYGON_COUNTS)
    largest = [results[polygons].error_px.max() for polygons in PAPER_POLYGON_COUNTS]
    figure, axes = plot("Geometric error of a mesh", "polygons", "error in pixels at 360 × 360")
    axes.loglog(counts, largest, "s-", color=ORANGE, label="largest")
    axes.loglog(counts, means, "o-", color=BLUE, label=f"mean, slope {slope:.3f}".replace("-", "−"))
    axes.loglog(counts, means[0] * counts[0] / counts, "--", color=GRAY, label="slope −1")
    axes.set_xticks(counts, [str(count) for count in counts])
    axes.minorticks_off()
    axes.legend(frameon=False)
    defaults = [sensor.resized(size) for size in DEFAULT_SIZES_PX]
    rows = tuple(
        (
            str(polygons),
            f"{result.error_px.mean():.3f}",
            f"{np.percentile(result.error_px, 95):.3f}",
            f"{result.error_px.max():.3f}",
            f"{result.psnr_db:.1f}",
        )
        for polygons, result in results.items()
    )
    views = {f"{polygons} polygons": result.image for polygons, result in results.items()}
    views["exact"] = exact.rgb
    return Section(
        title,
        "Images of 360 × 360 px by mirror meshes, against the exact capture. The error is the "
        "distance between a direction's positions in the images of mesh and mirror, from the GPU's "
        "rays. It is inversely proportional to the number of polygons. As in the paper, 256 "
        "polygons visibly bend straight lines, 1024 do not, and 4096 bring no visible gain. The "
        "default number keeps the largest error below 0.1 px at the image's size.",
        (
            Measure("slope of the log-log line, distance from −1", abs(slope + 1.0), bound=0.1),
            Measure("1024 polygons, mean error", float(paper.error_px.mean()), "px", 0.20),
            Measure("1024 polygons, largest error", float(paper.error_px.max()), "px", 0.40),
            *(
                Measure(f"default, {each.mesh_polygons} polygons, {each.model.width_px} px: "
                        "largest error", float(shown_error_px(fixture, each).max()), "px",
                        MAX_ERROR_PX)
                for each in defaults
            ),
            Measure("slope", slope),
        ),
        (ResultTable("Meshes against the exact capture, 360 × 360 px",
                     ("polygons", "mean px", "95 % px", "max px", "PSNR dB"), rows),),
        (
            CaptionedFigure("fig8-polygons", gallery(views, 3),
                    "The same view with increasing numbers of polygons, and the exact capture."),
            CaptionedFigure("fig9-detail",
                    gallery({name: image[DETAIL] for name, image in views.items()}, 3),
                    "The same detail, magnified: lines are jagged up to 256 polygons."),
            CaptionedFigure("convergence", figure,
                    "Error over the number of polygons: inversely proportional."),
        ),
    )  # fmt: skip


def shown_error_px(fixture: Fixture, sensor: OmniCamera) -> Floats:
    """Distances (n,) from pixels to the positions at which the mirror shows the pixels' rays.

    Pixels whose rays are past the rim are left out.
    """
    camera = mirror_camera(sensor)
    context = open_context(fixture.device)
    try:
        with context:
            rays, seen = PixelMap(context, camera, sensor.mesh_polygons).read_rays()
    finally:
        context.release()
    shown = camera.pixel_from_ray(rays[seen].astype(np.float64))
    pixels = pixel_grid(camera.width_px, camera.height_px)[seen]
    # directions past the rim, which a mesh may show, have no position in the mirror's image
    errors: Floats = np.linalg.norm(shown.positions_px - pixels, axis=-1)
    return errors[shown.valid]


# Single viewpoint: rays of the pinhole, reflected by the mirror's normals, meet in one point.
#
# Independent of the camera's shortcut: the ray is intersected with Eq. 1 as a quadric, and
# reflected by the gradient of Eq. 1.


# The focus property is exact: the error is float64 rounding, which grows with the path.
BOUND_C = 1e-9


def check_viewpoint(fixture: Fixture, title: str) -> Section:
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
        figures=[CaptionedFigure("single-viewpoint", _section_figure(mirror),
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


def _section_figure(mirror: HyperbolicMirror) -> Figure:
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
