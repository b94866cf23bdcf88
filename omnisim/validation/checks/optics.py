"""Optical systems: rays and caustics, triangles nearby, calibrations from chessboards."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from omnisim.cameras import EquidistantCamera, MirroredCamera, PerspectiveCamera, pixel_grid
from omnisim.cameras.mirrors.hyperbolic_mirror import PAPER_C, PAPER_K, PAPER_METERS_PER_UNIT
from omnisim.cameras.optics import (
    BoardCorners,
    Design,
    OpticalSystem,
    Surface,
    calibrate_system,
    caustic_points,
    fit_central,
    shapes,
)
from omnisim.cameras.optics.system_file import parse_optics
from omnisim.core.arrays import Bools, Floats
from omnisim.core.errors import OpticsError
from omnisim.core.poses import pose
from omnisim.ground_truth.hits import NO_DETAILS
from omnisim.plots.style import gallery
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.contract import CameraSetup, HitSource, ScenePoses
from omnisim.rendering.opengl.parallax_camera import ParallaxCamera
from omnisim.rendering.rays.caster import WorldRays
from omnisim.rendering.rays.ray_backend import RayHitSource
from omnisim.rendering.rays.ray_scene import RayScene
from omnisim.rendering.stage import Stage
from omnisim.report.report import CaptionedFigure, Measure, ResultTable, Section
from omnisim.scene import Scene, load_scene
from omnisim.validation import optical_systems as closed_forms
from omnisim.validation.fixture import Fixture
from omnisim.validation.optical_systems import (
    SIZE_PX,
    AxialPoints,
    AxialRays,
    TracedAxialRays,
    validation_systems,
)
from omnisim.validation.oracles import omnidir
from omnisim.validation.plain_scenes import DetectedBoards, board_corners_m, detected_boards

DISTANCES_M = (0.3, 1.0, 5.0)
STEP_PX, QUICK_STEP_PX = 3, 9  # between pixels of the round trips
ANGLE_BOUND_RAD, SHARE_BOUND = 1e-10, 1e-9
PIXEL_BOUND_PX, LOST_PERCENT = 1e-8, 0.01
CAUSTIC_BOUND = 1e-8  # share of a distance: from differences over thousandths of a pixel
_VERTEX_M, _RADIUS_M = 0.15, 0.03
_PORT_M, _PANES_M, _MEDIA = 0.05, (0.01,), (1.0, 1.49, 1.333)  # the pinhole is in the first
_WATER = 4.0 / 3.0


def check_rays(fixture: Fixture, title: str) -> Section:
    """Compare rays, caustics and projections, and check round trips."""
    forms = _closed_forms()
    rays = {name: traced.misses(form) for name, (traced, form) in forms.items()}
    sizes = {name: float(np.abs(traced.origins_m).max()) for name, (traced, _) in forms.items()}
    back = list(_round_trips(QUICK_STEP_PX if fixture.is_quick else STEP_PX))
    tried, missed = sum(row[2] for row in back), sum(row[3] for row in back)
    caustics = dict(_caustics())
    return Section(
        title,
        "Traced rays of a pinhole on the axis are compared with closed forms. Points on the rays "
        "of pixels, at 0.3, 1 and 5 m, are projected back to their pixels. Caustics are compared "
        "with closed forms: of mirrors by Coddington's equations (Swaminathan, Grossberg and Nayar "
        "2001), and of a flat boundary (Treibitz et al. 2012). Projections through a flat boundary "
        "are compared with the quartic equation of Agrawal et al. (2012).",
        (
            Measure("largest angle to a closed form", max(angle for angle, _ in rays.values()),
                    "rad", ANGLE_BOUND_RAD),
            Measure("largest distance of an origin, as a share of the size",
                    max(rays[name][1] / sizes[name] for name in rays), "", SHARE_BOUND),
            Measure(f"points that do not return to their pixel within {PIXEL_BOUND_PX:g} px",
                    100.0 * missed / tried, "%", LOST_PERCENT),
            Measure("points", tried),
            Measure("caustics, largest distance as a share of the size",
                    max(caustics.values()), "", CAUSTIC_BOUND),
            Measure("pixels through a flat boundary against a quartic's root",
                    _quartic_error_px(), "px", PIXEL_BOUND_PX),
        ),
        tables=(
            ResultTable("Rays against closed forms", ("system", "angle, rad", "origin, m"),
                        tuple((name, f"{angle:.1e}", f"{away:.1e}")
                              for name, (angle, away) in rays.items())),
            ResultTable("Points that do not return to their pixel",
                        ("system", "at", "points", "others"),
                        tuple((name, f"{distance:g} m", str(count), str(others))
                              for name, distance, count, others in back if others)),
            ResultTable("Caustics", ("system", "largest distance, share of the size"),
                        tuple((name, f"{error:.1e}") for name, error in caustics.items())),
        ),
    )  # fmt: skip


def _system(
    shape: shapes.Shape, at_m: float, rim_m: float, focal_px: float = 800.0
) -> OpticalSystem:
    """Optical system of a pinhole and one mirror, which is centered on the pinhole's axis."""
    return OpticalSystem(_pinhole(focal_px), (Surface(shape, pose((0.0, 0.0, at_m)), rim_m),))


def _pinhole(focal_px: float) -> PerspectiveCamera:
    middle = 0.5 * (SIZE_PX - 1)
    return PerspectiveCamera(SIZE_PX, SIZE_PX, focal_px, (middle, middle))


def _flat(*boundaries: tuple[float, float]) -> OpticalSystem:
    """Pinhole in air before flat boundaries: distance in m and refractive index behind each."""
    surfaces = (
        Surface(shapes.Plane(), pose((0.0, 0.0, z)), medium=index) for z, index in boundaries
    )
    return OpticalSystem(_pinhole(180.0), tuple(surfaces), medium=1.0)


def _closed_forms() -> dict[str, tuple[TracedAxialRays, AxialRays]]:
    hyperbolic = shapes.Hyperbolic()
    panes = zip(np.cumsum((_PORT_M, *_PANES_M)).tolist(), _MEDIA[1:], strict=True)
    port = _flat(*panes)
    systems = {
        "sphere": _system(shapes.Conic(_RADIUS_M), _VERTEX_M, 0.029),
        "sphere, as a profile": _system(shapes.Asphere(_RADIUS_M), _VERTEX_M, 0.029),
        "cone": _system(shapes.Cone(50.0), 0.12, 0.06, 450.0),
        "paper's hyperboloid": _system(hyperbolic, hyperbolic.vertex_m, 0.012, 1300.0),
        "paraboloid": _system(shapes.Conic(_RADIUS_M, -1.0), _VERTEX_M, 0.03),
        "paraboloid, as a profile": _system(
            shapes.Polynomial((0.0, 0.5 / _RADIUS_M)), _VERTEX_M, 0.03
        ),
        "flat port": port,
    }
    traced = {name: closed_forms.traced_rays(system) for name, system in systems.items()}
    focus_m = 0.5 * PAPER_C * PAPER_METERS_PER_UNIT
    semi_axis_m = focus_m * math.sqrt(1.0 - 2.0 / PAPER_K)  # Eq. 1

    def expected(name: str, beta: Floats) -> AxialRays:
        match name.partition(",")[0]:
            case "sphere":
                return closed_forms.sphere(beta, _VERTEX_M, _RADIUS_M)
            case "cone":
                return closed_forms.cone(beta, 0.12, math.radians(50.0))
            case "paraboloid":
                return closed_forms.paraboloid(beta, _VERTEX_M, _RADIUS_M)
            case "flat port":
                return closed_forms.flat_port(beta, _PORT_M, _PANES_M, _MEDIA)
            case _:
                return closed_forms.hyperboloid(beta, focus_m, semi_axis_m)

    return {name: (rays, expected(name, rays.beta_rad)) for name, rays in traced.items()}


def _caustics() -> Iterator[tuple[str, float]]:
    """Maximum distances from caustics in closed form, by system."""
    for name, conic in (("sphere", 0.0), ("paraboloid", -1.0)):
        system = _system(shapes.Conic(_RADIUS_M, conic), _VERTEX_M, 0.028)
        traced = closed_forms.traced_rays(system, 41)
        form = closed_forms.sphere if conic == 0.0 else closed_forms.paraboloid
        rays = form(traced.beta_rad, _VERTEX_M, _RADIUS_M)
        steepness = 1.0 - conic * (rays.radii_m / _RADIUS_M) ** 2
        across = 1.0 / (_RADIUS_M * np.sqrt(steepness))
        sheets = closed_forms.mirror_caustic(traced.beta_rad, rays, across / steepness, across)
        yield name, _caustic_error(system, traced, sheets)
    system = _flat((_PORT_M, _WATER))
    traced = closed_forms.traced_rays(system, 41)
    sheets = closed_forms.flat_port_caustic(traced.beta_rad, _PORT_M, _WATER)
    yield "flat boundary", _caustic_error(system, traced, sheets)


def _caustic_error(
    system: OpticalSystem, traced: TracedAxialRays, sheets: tuple[AxialPoints, AxialPoints]
) -> float:
    """Maximum distance between traced and expected caustics, as a share of their coordinates.

    Traced sheets match expected sheets in either order.
    """
    caustic = caustic_points(system, traced.pixels_px)
    known = np.isfinite(caustic).all(axis=(1, 2))  # not next to the rim
    expected = np.stack([traced.place(sheet) for sheet in sheets], axis=1)
    orders = [np.linalg.norm(caustic - expected[:, order], axis=2) for order in ((0, 1), (1, 0))]
    away = np.minimum(orders[0].max(axis=1), orders[1].max(axis=1))[known]
    return float((away / np.abs(expected[known]).max(axis=(1, 2))).max())


def _quartic_error_px() -> float:
    """Maximum distance between pixels of points by Newton's method and by a quartic's roots.

    NaN if a point is not visible.
    """
    system, focal_px = _flat((_PORT_M, _WATER)), 180.0
    generator = np.random.default_rng(5)
    radii_m, depths_m = generator.uniform(0.01, 0.4, 200), generator.uniform(0.3, 5.0, 200)
    points_m = np.column_stack((radii_m, np.zeros(200), _PORT_M + depths_m))
    seen = system.pixel_from_point(points_m)
    errors = []
    projected = zip(seen.positions_px, seen.valid, radii_m, depths_m, strict=True)
    for pixel, valid, radius_m, depth_m in projected:
        roots = closed_forms.flat_port_radius(radius_m, depth_m, _PORT_M, _WATER)
        expected_px = [0.5 * (SIZE_PX - 1) + focal_px * root / _PORT_M for root in roots]
        distances_px = [abs(u - pixel[0]) for u in expected_px if valid]
        errors.append(min(distances_px, default=math.nan))
    return float(np.max(errors))


def _round_trips(step_px: int) -> Iterator[tuple[str, float, int, int]]:
    """Yield system, distance in m, number of points, and number of points that miss their pixel."""
    systems = validation_systems()
    middle = 0.5 * (SIZE_PX - 1)
    fisheye = EquidistantCamera(SIZE_PX, SIZE_PX, 120.0, (middle, middle), math.radians(80.0))
    for name in ("flat port", "dome port"):
        systems[f"fisheye, {name}"] = OpticalSystem(fisheye, systems[name].surfaces)
    systems["asphere"] = _system(shapes.Asphere(_RADIUS_M, 0.0, (1e3,)), _VERTEX_M, 0.028)
    systems["polynomial"] = _system(shapes.Polynomial((0.1, 16.0, 0.0, 4e3)), _VERTEX_M, 0.028)
    profile = Design(0.1, 20.0).equi_angular(105.0)
    table = shapes.TabulatedProfile(profile.radii_m, profile.heights_m)
    systems["table, equi-angular"] = _system(table, 0.1, table.domain_m, 494.5)
    for (name, system), distance_m in itertools.product(systems.items(), DISTANCES_M):
        pixels = pixel_grid(system.width_px, system.height_px)[::step_px, ::step_px].reshape(-1, 2)
        rays = system.rays(pixels)
        points_m = rays.origins_m[rays.valid] + distance_m * rays.directions[rays.valid]
        seen = system.pixel_from_point(points_m)
        away_px = np.linalg.norm(seen.positions_px - pixels[rays.valid], axis=1)
        good: Bools = seen.valid & (away_px <= PIXEL_BOUND_PX)
        yield name, distance_m, len(good), int((~good).sum())


# Triangles at the pixels of optical systems near furniture, against rays cast by Embree.


SCENES = ("soccer", "mapping")
SYSTEMS = ("tilted mirror", "sphere", "cone")
CAST_BOUND, ALONE_BOUND, UNDECIDED_BOUND = 99.9, 99.4, 100.0
BESIDE_M = 0.2
_DIRECTIONS = 720  # searched for the nearest object
_MIN_M = 0.05


def check_triangles(fixture: Fixture, title: str) -> Section:
    """Compare the triangles by virtual cameras and by rays, close to an object in each scene."""
    names = SCENES[:1] if fixture.is_quick else SCENES
    compared = {
        (name, system): shares
        for name in names
        for system, shares in measure_triangles(fixture, load_scene(name)).items()
    }
    return triangle_section(title, compared)


def measure_triangles(fixture: Fixture, scene: Scene) -> dict[str, SameTriangles]:
    """Shares of pixels with equal triangles, by system name, close to an object in a scene."""
    shares = {}
    with Stage(scene, device=fixture.device) as stage:
        rays = RayScene(scene)
        for name in SYSTEMS:
            sensor = OmniCamera(validation_systems()[name])
            start = sensor.base_pose(scene.start.position_m, yaw_deg=scene.start.yaw_deg)
            pose = pose_beside_nearest(sensor, rays, start)
            shares[name] = same_triangles(stage, rays, sensor, pose)
    return shares


def triangle_section(title: str, compared: Mapping[tuple[str, str], SameTriangles]) -> Section:
    """Section of the report with shares of pixels, given by scene and system."""
    shares = list(compared.values())
    cast = [share.undecided_cast for share in shares if not math.isnan(share.undecided_cast)]
    return Section(
        title,
        "Share of pixels that show the first triangle on their exact ray, as cast by Embree, from "
        f"positions {BESIDE_M} m from the nearest object. Virtual cameras at one viewpoint leave "
        "some pixels undecided; the shares are with and without rays for these pixels.",
        (
            Measure("same triangle, rays for undecided pixels",
                    100.0 * min(share.cast for share in shares), "%", CAST_BOUND, at_least=True),
            Measure("same triangle, virtual cameras alone",
                    100.0 * min(share.alone for share in shares), "%", ALONE_BOUND, at_least=True),
            Measure("same triangle, of the undecided pixels by rays",
                    100.0 * min(cast, default=math.nan), "%", UNDECIDED_BOUND, at_least=True),
        ),
        (ResultTable("Pixels of the same triangle in %",
                     ("scene", "system", "with rays", "without", "undecided"),
                     tuple((scene, system, f"{100.0 * share.cast:.3f}",
                            f"{100.0 * share.alone:.3f}", f"{100.0 * share.undecided:.2f}")
                           for (scene, system), share in compared.items())),),
    )  # fmt: skip


class SameTriangles(NamedTuple):
    """Shares of pixels at which the triangle is that of the pixel's exact ray."""

    cast: float  # among all pixels, with undecided pixels cast as rays
    alone: float  # among all pixels, by the virtual cameras only
    decided: float  # among the pixels that the virtual cameras decide
    undecided_cast: float  # among undecided pixels, cast as rays; NaN: no undecided pixels
    undecided: float  # share of undecided pixels among all pixels


def same_triangles(
    stage: Stage, rays: RayScene, sensor: OmniCamera, world_from_base: Floats
) -> SameTriangles:
    """Compare the triangles of virtual cameras and of exact rays at all valid pixels.

    Raises:
        OpticsError: the sensor is central.
    """
    poses = ScenePoses(world_from_base @ sensor.base_from_rig, ())
    with stage.current():
        camera = stage.backend.camera(CameraSetup(sensor, False, frozenset(), 0, ()))
        if not isinstance(camera, ParallaxCamera):
            raise OpticsError("camera: expected an optical system, got a central camera")
        judge = RayHitSource(rays, camera.setup)
        expected = _Triangles.of(judge, poses)
        sources = camera.make_hits(NO_DETAILS, True), camera.make_hits(NO_DETAILS, False)
        cast, alone = (
            _Triangles.of(source, poses).equal(expected)[judge.has_ray] for source in sources
        )
        undecided = sources[1].undecided[judge.has_ray]
    stage.collect()
    return SameTriangles(
        float(cast.mean()),
        float(alone.mean()),
        float(alone[~undecided].mean()),
        float(cast[undecided].mean()) if undecided.any() else np.nan,
        float(undecided.mean()),
    )


def pose_beside_nearest(sensor: OmniCamera, rays: RayScene, start: Floats) -> Floats:
    """Pose (4, 4) of the base, moved horizontally until its sensor is `BESIDE_M` from an object.

    The object is the nearest at the sensor's height, among those at least twice as far away.
    """
    sensor_m = (start @ sensor.base_from_rig)[:3, 3]
    angles = np.linspace(0.0, 2.0 * np.pi, _DIRECTIONS, endpoint=False)
    directions = np.stack((np.cos(angles), np.sin(angles), 0.0 * angles), axis=1)
    near_m, far_m = np.full(len(angles), _MIN_M), np.full(len(angles), np.inf)
    origins_m = np.tile(sensor_m, (len(angles), 1))
    ranges_m = rays.first_hits(WorldRays(origins_m, directions, near_m, far_m)).ranges_m
    nearest = int(np.argmin(np.where(ranges_m > 2.0 * BESIDE_M, ranges_m, np.inf)))
    away_m = (ranges_m[nearest] - BESIDE_M) * directions[nearest]
    return pose(tuple(away_m.tolist())) @ start


class _Triangles(NamedTuple):
    """Triangle indices and instance names at pixels (height, width)."""

    names: NDArray[np.str_]  # of the instances
    numbers: NDArray[np.uint32]

    @staticmethod
    def of(source: HitSource, poses: ScenePoses) -> _Triangles:
        """Triangles hit by the rays of all pixels, for the given poses."""
        hits = source.hits(poses)
        names = np.array(["", *(name for _, name in source.draws)])
        return _Triangles(names[hits.draw_ids], hits.triangles)

    def equal(self, other: _Triangles) -> Bools:
        """Mask (height, width) of pixels with equal triangles, or with none in both."""
        same = (self.numbers == other.numbers) | (self.names == "")
        return same & (self.names == other.names)


# Calibration from chessboards in the paper's mirror, aligned and not, by OpenCV and by omnisim.


BOARD_IMAGE_PX = 720
BOARDS, QUICK_BOARDS = 20, 10
TILT_DEG, SHIFT_M = 2.0, 0.002
BOARD_M = 0.7  # approximate distance from the mirror
# Corners are detected to a tenth of a pixel: the mirror bends their edges.
RMS_BOUND_PX = 0.15
# Four standard deviations for ten boards; the position along the axis correlates with distances.
TILT_BOUND_DEG, SHIFT_BOUND_MM, ALONG_BOUND_MM = 0.05, 0.03, 0.2
CENTER_BOUND_PX = 2.0  # the principal point correlates with focal length, ξ and distortion
_ASIDE = ("surfaces.0.decenter_m.0", "surfaces.0.decenter_m.1")
_ALONG = "surfaces.0.decenter_m.2"
_TILTS = ("surfaces.0.tilt_deg.0", "surfaces.0.tilt_deg.1")
_PARAMETERS = (*_ASIDE, _ALONG, *_TILTS)


def check_calibration(fixture: Fixture, title: str) -> Section:
    """Calibrate from the same boards through the aligned and the misaligned mirror."""
    size = (BOARD_IMAGE_PX, BOARD_IMAGE_PX)
    aligned = boards_in_mirror(fixture, mirror_table(0.0, 0.0))
    tilted = boards_in_mirror(fixture, mirror_table(TILT_DEG, SHIFT_M))
    points_m = board_corners_m()
    plain = omnidir.calibrate(points_m, aligned.corners, size)
    tilted_plain = omnidir.calibrate(points_m, tilted.corners, size)
    distorted = omnidir.calibrate(points_m, tilted.corners, size, distorted=True)
    central = fit_central(
        parse_optics(mirror_table(TILT_DEG, SHIFT_M)), "opencv_omnidir", right_at_m=BOARD_M
    ).cameras[0]
    assert isinstance(central.camera, MirroredCamera)
    center_px = np.linalg.norm(distorted.principal_point_px - central.camera.principal_point_px)
    fits = []
    for detected in (aligned, tilted):
        boards = [BoardCorners(points_m[:, :2], corners) for corners in detected.corners]
        fits.append(calibrate_system(mirror_table(0.0, 0.0), _PARAMETERS, boards))
    rms_px = [float(np.sqrt(np.square(fit.errors_px).sum(axis=1).mean())) for fit in fits]
    rows, errors = [], dict.fromkeys(_PARAMETERS, 0.0)
    for name, fit, tilt_deg, shift_m in (
        ("aligned", fits[0], 0.0, 0.0),
        ("misaligned", fits[1], TILT_DEG, SHIFT_M),
    ):
        truths = dict.fromkeys(_PARAMETERS, 0.0) | {_TILTS[0]: tilt_deg, _ASIDE[0]: shift_m}
        for fitted in fit.parameters:
            key, value = fitted.name, fitted.value
            errors[key] = max(errors[key], abs(value - truths[key]))
            rows.append((name, key, f"{truths[key]:g}", f"{value:.6f}", f"{fitted.sigma:.6f}"))
    return Section(
        title,
        "Calibrations from chessboards seen in the paper's mirror, once aligned, once tilted by "
        f"{TILT_DEG:g}° and offset by {1e3 * SHIFT_M:g} mm, at {SIZE_PX} × {SIZE_PX} px, with "
        "corners detected by OpenCV. cv2.omnidir calibrates the nearest central camera. Without "
        "distortion, its residual shows the misalignment; with distortion, its principal point is "
        "that of omnisim's central fit. Least squares over the mirror's pose, starting at the "
        "aligned pose, recover the misalignment.",
        (
            Measure("aligned, cv2.omnidir: reprojection, RMS", plain.rms_px, "px", RMS_BOUND_PX),
            Measure("misaligned, cv2.omnidir without distortion, RMS", tilted_plain.rms_px, "px"),
            Measure("misaligned, cv2.omnidir with distortion, RMS", distorted.rms_px, "px",
                    RMS_BOUND_PX),
            Measure("principal point: our central fit from cv2.omnidir's", float(center_px), "px",
                    CENTER_BOUND_PX),
            Measure("the mirror's own pose: reprojection, RMS", max(rms_px), "px",
                    RMS_BOUND_PX),
            Measure("fitted tilt, largest error", max(errors[key] for key in _TILTS), "°",
                    TILT_BOUND_DEG),
            Measure("fitted lateral shift, largest error", 1e3 * max(errors[key] for key in _ASIDE),
                    "mm", SHIFT_BOUND_MM),
            Measure("fitted axial shift, largest error", 1e3 * errors[_ALONG], "mm",
                    ALONG_BOUND_MM),
            Measure("boards", len(aligned.corners) + len(tilted.corners)),
        ),
        (ResultTable("The mirror's pose by least squares, in meters and degrees.",
                     ("mirror", "parameter", "true", "found", "σ"), tuple(rows)),),
        figures=[CaptionedFigure("optics-chessboards",
                 gallery({f"board {i + 1}": b for i, b in enumerate(tilted.images[:6])}, 3),
                 "Six of the chessboards seen in the misaligned mirror.")],
    )  # fmt: skip


def mirror_table(tilt_deg: float, shift_m: float) -> dict[str, Any]:
    """Table of an optics file with the paper's mirror, tilted about x and shifted along x."""
    camera = {
        "model": "perspective", "width_px": BOARD_IMAGE_PX, "height_px": BOARD_IMAGE_PX,
        "focal_length_px": 1330.0 / 360.0 * BOARD_IMAGE_PX,
    }  # fmt: skip
    mirror = {
        "shape": "hyperbolic", "rim_radius_m": 0.0119,
        "decenter_m": [shift_m, 0.0, 0.0], "tilt_deg": [tilt_deg, 0.0, 0.0],
    }  # fmt: skip
    return {"origin_m": [0.0, 0.0, 0.09284], "camera": camera, "surfaces": [mirror]}


def boards_in_mirror(fixture: Fixture, table: dict[str, Any]) -> DetectedBoards:
    """Render the boards through a mirror, and detect their corners."""
    count = QUICK_BOARDS if fixture.is_quick else BOARDS
    return detected_boards(fixture, OmniCamera(parse_optics(table)), count)
