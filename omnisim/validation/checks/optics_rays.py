"""Rays of optical systems against closed forms and published results, and back to their pixels."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator

import numpy as np

from omnisim.cameras import EquidistantCamera, PerspectiveCamera, pixel_grid
from omnisim.cameras.mirrors.hyperbolic_mirror import PAPER_C, PAPER_K, PAPER_METERS_PER_UNIT
from omnisim.cameras.optics import Design, OpticalSystem, Surface, caustic_points, shapes
from omnisim.core.arrays import Bools, Floats
from omnisim.core.poses import pose
from omnisim.report.report import Measure, ResultTable, Section
from omnisim.validation import optical_systems as closed_forms
from omnisim.validation.fixture import Fixture
from omnisim.validation.optical_systems import (
    SIZE_PX,
    AxialPoints,
    AxialRays,
    TracedAxialRays,
    validation_systems,
)

DISTANCES_M = (0.3, 1.0, 5.0)
STEP_PX, QUICK_STEP_PX = 3, 9  # between pixels of the round trips
ANGLE_BOUND_RAD, SHARE_BOUND = 1e-10, 1e-9
PIXEL_BOUND_PX, LOST_PERCENT = 1e-8, 0.01
CAUSTIC_BOUND = 1e-8  # share of a distance: from differences over thousandths of a pixel
_VERTEX_M, _RADIUS_M = 0.15, 0.03
_PORT_M, _PANES_M, _MEDIA = 0.05, (0.01,), (1.0, 1.49, 1.333)  # the pinhole is in the first
_WATER = 4.0 / 3.0


def check(fixture: Fixture, title: str) -> Section:
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
            Measure(f"points that do not come back to their pixel to {PIXEL_BOUND_PX:g} px",
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
            ResultTable("Points that do not come back to their pixel",
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
