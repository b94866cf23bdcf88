"""Curves of point spread and lateral color over the image radius, as parameters of a camera."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from omnisim.measurement.quantity import Quantity, Unobservable
from omnisim.measurement.sharpness.edge_fit import Floats
from omnisim.measurement.sharpness.field_fits import (
    MAX_COLOR_DEGREE,
    MAX_SPREAD_DEGREE,
    MIN_SPREAD,
    Curve,
    fit_curve,
    offset_rows,
    spread_rows,
)
from omnisim.measurement.sharpness.slanted_edge import EdgeSharpness
from omnisim.rendering.camera.degradations import ChromaticAberration, PointSpread
from omnisim.rendering.camera.degradations.image_geometry import ImageGeometry
from omnisim.rendering.camera.degradations.point_spread import MAX_WIDTH_PX

KNOTS = 7  # rows of the point spread
SIGNIFICANT = 2.0  # standard deviations
SYSTEMATIC, SYSTEMATIC_PX2 = 0.005, 0.0015  # of a variance: error of an edge without noise
SYSTEMATIC_PX = 0.003  # of a shift, likewise
MIN_RADIAL = 0.3  # cosine between normal and radius of an edge that shows lateral color
MIN_COLOR_EDGES = 6
MIN_FIELD = 0.6  # share of the largest possible radius
DIGITS = 4  # of the keys: their errors depend on each other, and rounding would add its own


@dataclass(frozen=True, eq=False)
class FieldCurves:
    """Point spread and lateral color over the field, with the measured quantities.

    Attributes:
        radii_px: (edges,) image radius of each edge.
        point_spread, chromatic_aberration: degradations for the sensor file; None: not determined.
        quantities: measured quantities.
        unobservable: quantities that the edges do not determine.
    """

    radii_px: Floats
    point_spread: PointSpread | None
    chromatic_aberration: ChromaticAberration | None
    quantities: list[Quantity]
    unobservable: list[Unobservable]


def field_curves(
    edges: Sequence[EdgeSharpness], size_px: tuple[int, int], center_px: tuple[float, float]
) -> FieldCurves:
    """Fit point spread and lateral color to edges in images of one size.

    Args:
        edges: measured edges, at least one.
        size_px: width and height of the images.
        center_px: (u, v) of the center of the radii.
    """
    unit_px = ImageGeometry(*size_px, center_px).radius_unit_px
    offsets = np.array([edge.center_px for edge in edges]) - center_px
    radii_px = np.hypot(offsets[:, 0], offsets[:, 1])
    normals = np.array([edge.normal for edge in edges])
    outward = offsets / np.maximum(radii_px, 1e-9)[:, None]
    radial = (outward * normals).sum(axis=1)
    curves = FieldCurves(radii_px, None, None, [], [])
    spread = _point_spread(edges, radii_px, radial**2, unit_px, curves)
    corners = np.array([(u, v) for u in (0, size_px[0] - 1) for v in (0, size_px[1] - 1)])
    farthest_px = float(np.hypot(*(corners - center_px).T).max())
    if radii_px.max() < MIN_FIELD * farthest_px:
        reason = (
            f"no edge beyond {radii_px.max():.0f} px of {farthest_px:.0f} px, where the last value "
            "stays: photograph edges up to the corners"
        )
        curves.unobservable.append(Unobservable("sharpness of the outer field", reason))
    color = _lateral_color(edges, radii_px, radial, unit_px, curves)
    return FieldCurves(radii_px, spread, color, curves.quantities, curves.unobservable)


def _point_spread(
    edges: Sequence[EdgeSharpness],
    radii_px: Floats,
    radial_share: Floats,
    unit_px: float,
    curves: FieldCurves,
) -> PointSpread | None:
    """Fit widths over the radius; None: too sharp. Adds the quantities of both kinds to `curves`.

    Args:
        edges: measured edges.
        radii_px: (edges,) image radius of each edge.
        radial_share: (edges,) squared cosine between the edge's normal and the radius.
        unit_px: unit of relative radii.
        curves: result to which quantities are added.
    """
    variances = np.array([edge.variance_px2 for edge in edges])
    sigmas = np.array([edge.variance_sigma_px2 for edge in edges])
    sigmas = np.hypot(sigmas, SYSTEMATIC_PX2 + SYSTEMATIC * np.abs(variances))
    isotropic = float(radial_share.std()) < MIN_SPREAD
    if isotropic:
        reason = "all edges have like angles to the radius: photograph a board turned by 45°, too"
        curves.unobservable.append(
            Unobservable("difference of radial and tangential width", reason)
        )
    radii = radii_px / unit_px

    def design(degree: int) -> Floats:
        return spread_rows(radii, radial_share, degree, isotropic)

    degrees = range(MAX_SPREAD_DEGREE + 1) if np.ptp(radii) > 0.1 else range(1)
    curve = fit_curve(design, variances, sigmas, degrees)
    knots = KNOTS if curve.degree > 0 else 1
    at_px = np.linspace(radii_px.min(), radii_px.max(), knots) if knots > 1 else np.zeros(1)
    rows = [_widths(curve, at_px / unit_px, share, isotropic) for share in (1.0, 0.0)]
    if all((widths < SIGNIFICANT * errors).all() for widths, errors in rows):
        reason = "the edges are as sharp as pixels alone make them: the optics cannot be seen"
        curves.unobservable.append(Unobservable("point_spread", reason))
        return None
    basis = f"{int(curve.used.sum())} edges, degree {curve.degree}"
    for name, (widths, errors) in zip(("radial", "tangential"), rows, strict=True):
        for radius, width, error in zip(at_px, widths, errors, strict=True):
            place = f" {radius:.0f} px" if knots > 1 else ""
            curves.quantities.append(
                Quantity(f"{name}{place}", float(width), float(error), "px", basis)
            )
    table = np.stack((at_px, rows[0][0], rows[1][0]), axis=-1).round(DIGITS)
    table[:, 0] = table[:, 0].round(1)
    table[:, 1:] = np.minimum(table[:, 1:], MAX_WIDTH_PX)
    return PointSpread(tuple((row[0], row[1], row[2]) for row in table.tolist()))


def _widths(
    curve: Curve, radii: Floats, radial_share: float, isotropic: bool
) -> tuple[Floats, Floats]:
    """Widths (n,) at relative radii (n,) in one direction, and their standard deviations, px."""
    shares = np.full_like(radii, radial_share)
    variances, sigmas = curve.at(spread_rows(radii, shares, curve.degree, isotropic))
    widths = np.sqrt(np.maximum(variances, 0.0))
    # of a root near zero
    return widths, np.minimum(sigmas / (2.0 * np.maximum(widths, 1e-9)), np.sqrt(sigmas))


def _lateral_color(
    edges: Sequence[EdgeSharpness],
    radii_px: Floats,
    radial: Floats,
    unit_px: float,
    curves: FieldCurves,
) -> ChromaticAberration | None:
    """Fit the offsets of red and blue; None: too few edges. Adds quantities to `curves`.

    Args:
        edges: measured edges.
        radii_px: (edges,) image radius of each edge.
        radial: (edges,) cosine between the edge's normal and the radius.
        unit_px: unit of relative radii.
        curves: result to which quantities and unobservable ones are added.
    """
    shifts = np.array([edge.shifts_px for edge in edges])
    sigmas = np.hypot([edge.shift_sigmas_px for edge in edges], SYSTEMATIC_PX)
    usable = (np.abs(radial) > MIN_RADIAL) & np.isfinite(shifts).all(axis=1)
    if usable.sum() < MIN_COLOR_EDGES:
        reason = f"{int(usable.sum())} edges across the radius, expected {MIN_COLOR_EDGES}"
        if not np.isfinite(shifts).any():
            reason = "the images have one channel: save demosaicked linear images of three"
        curves.unobservable.append(Unobservable("lateral color", reason))
        return None
    coefficients: list[tuple[float, ...]] = []
    at_px = np.array((0.5, 1.0)) * radii_px[usable].max()
    for index, name in enumerate(("red", "blue")):
        values, errors = shifts[usable, index], sigmas[usable, index]
        # the polynomial is one of the radius at which the color itself lies
        radii = (radii_px[usable] + values / radial[usable]) / unit_px

        def design(degree: int, radii: Floats = radii) -> Floats:
            return offset_rows(radii, radial[usable], degree)

        curve = fit_curve(design, values, errors, range(1, MAX_COLOR_DEGREE + 1))
        coefficients.append(tuple(curve.coefficients.round(DIGITS).tolist()))
        offsets = curve.at(offset_rows(at_px / unit_px, np.ones(2), curve.degree))
        basis = f"{int(curve.used.sum())} edges, degree {curve.degree}"
        for radius, offset, sigma in zip(at_px, *offsets, strict=True):
            curves.quantities.append(
                Quantity(f"{name} {radius:.0f} px", offset, sigma, "px", basis)
            )
    return ChromaticAberration(red_offsets_px=coefficients[0], blue_offsets_px=coefficients[1])
