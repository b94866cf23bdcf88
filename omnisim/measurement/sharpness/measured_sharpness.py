"""Point spread and lateral color over the field, from slanted edges in any number of images."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from omnisim.cameras.optics.system_calibration import BoardCorners
from omnisim.core.arrays import Bools, Floats
from omnisim.core.errors import MeasurementError
from omnisim.measurement import Quantity, Unobservable
from omnisim.measurement.sharpness.slanted_edge import (
    GREEN,
    EdgeSharpness,
    Flaw,
    UnusableEdge,
    board_edges,
    find_edges,
    linear_light,
    measure_edge,
)
from omnisim.rendering.camera.degradations import ChromaticAberration, Encoding, PointSpread
from omnisim.rendering.camera.degradations.image_geometry import ImageGeometry
from omnisim.rendering.camera.degradations.point_spread import MAX_WIDTH_PX

MAX_ASYMMETRY = 0.02  # mean over the edges; gamma-encoded values have 0.03 and more
_SIGMAS = 4.0  # of an asymmetry's noise that it must exceed
RINGS = 3  # of the field, for means
_REMEDY = "photograph slanted black and white edges, such as a turned chessboard"


@dataclass(frozen=True, eq=False)
class MeasuredSharpness:
    """Sharpness of a camera."""

    point_spread: PointSpread | None  # None: the optics are sharper than the pixels show
    chromatic_aberration: ChromaticAberration | None  # lateral color; None: not measured
    quantities: tuple[Quantity, ...]
    unobservable: tuple[Unobservable, ...]  # not determined by the images
    edges: tuple[EdgeSharpness, ...]
    flaws: dict[Flaw, int]  # number of unusable edges for each reason
    size_px: tuple[int, int]  # width and height of the images
    center_px: tuple[float, float]  # (u, v) of the center of the radii


def measure_sharpness(
    images: Iterable[NDArray[Any]],
    *,
    boards: Sequence[BoardCorners | None] | None = None,
    center_px: tuple[float, float] | None = None,
    encoding: Encoding | None = None,
    names: Sequence[str] | None = None,
    edges_only: Callable[[EdgeSharpness], bool] = lambda _: True,
) -> MeasuredSharpness:
    """Measure the sharpness of a camera.

    Args:
        images: (height, width) or (height, width, 3) integers, or floats with 1: white; only one
            image is in memory at a time.
        boards: corners of a board of squares in each image; None: all straight edges are used.
        center_px: (u, v) of the optical axis; None: the middle of the image.
        encoding: encoding of the values; None: linear, which is checked.
        names: names of the images in messages.
        edges_only: function that returns True for the edges to use.

    Raises:
        MeasurementError: no images, several sizes, no usable edges, or values that are not linear.
    """
    edges: list[EdgeSharpness] = []
    flaws: Counter[Flaw] = Counter()
    size_px: tuple[int, int] | None = None
    for number, pixels in enumerate(images):
        name = names[number] if names else f"image {number}"
        height, width = pixels.shape[:2]
        if size_px not in (None, (width, height)):
            expected = f"expected images of one size, {size_px[0]} × {size_px[1]} px"
            raise MeasurementError(f"{name}: {expected}, got {width} × {height} px")
        size_px = width, height
        light, clipped = linear_light(pixels, encoding, name)
        board = boards[number] if boards is not None and number < len(boards) else None
        if boards is None:
            lines = find_edges(light[..., GREEN if light.shape[2] == 3 else 0])
        else:
            lines = board_edges(board) if board is not None else []
        for line in lines:
            try:
                edges.append(measure_edge(light, clipped, line, number))
            except UnusableEdge as reason:
                flaws[reason.args[0]] += 1
    if size_px is None:
        raise MeasurementError(f"expected images of edges, got none: {_REMEDY}")
    edges = [edge for edge in edges if edges_only(edge)]
    first = f"{names[0] if names else 'images'} and others"
    if not edges and not flaws:
        raise MeasurementError(f"{first}: no edges found: {_REMEDY}")
    if not edges:
        flaw, count = flaws.most_common(1)[0]
        raise MeasurementError(
            f"{first}: none of {flaws.total()} edges is usable; {count} are {flaw.value}"
        )
    if encoding is None:
        _check_linear(edges)
    if center_px is None:
        center_px = 0.5 * (size_px[0] - 1), 0.5 * (size_px[1] - 1)
    curves = field_curves(edges, size_px, center_px)
    return MeasuredSharpness(
        point_spread=curves.point_spread, chromatic_aberration=curves.chromatic_aberration,
        quantities=(*_ring_quantities(edges, curves), *curves.quantities),
        unobservable=tuple(curves.unobservable), edges=tuple(edges), flaws=dict(flaws),
        size_px=size_px, center_px=center_px,
    )  # fmt: skip


def _check_linear(edges: Sequence[EdgeSharpness]) -> None:
    """Reject edges whose dark half is narrower or wider than the bright one: not linear."""
    asymmetries = np.array([edge.asymmetry for edge in edges])
    middle = float(np.median(asymmetries))
    spread = 1.4826 * float(np.median(np.abs(asymmetries - middle)))
    sigma = max(spread / np.sqrt(len(edges)), 0.002 if len(edges) > 1 else np.inf)
    if abs(middle) > MAX_ASYMMETRY and abs(middle) > _SIGMAS * sigma:
        raise MeasurementError(
            f"images: the edges are {100.0 * abs(middle):.1f} % wider on one half, as in "
            "gamma-encoded values: save linear (raw) images, or give their response, such as srgb "
            "or 2.2 (1: linear)"
        )


def _ring_quantities(edges: Sequence[EdgeSharpness], curves: FieldCurves) -> list[Quantity]:
    """Mean MTF50 and mean 10-90 % edge rise in each of three rings of equal width."""
    ends = np.linspace(0.0, float(curves.radii_px.max()) + 1e-9, RINGS + 1)
    quantities = []
    for first, last in pairwise(ends.tolist()):
        pairs = zip(edges, curves.radii_px, strict=True)
        ring = [edge for edge, radius in pairs if first <= radius < last]
        if not ring:
            continue
        place, basis = f"{first:.0f}-{last:.0f} px", f"{len(ring)} edges"
        mtf50 = [(edge.mtf50, edge.mtf50_sigma) for edge in ring]
        rise = [(edge.rise_px, edge.rise_sigma_px) for edge in ring]
        quantities.append(_mean(f"mtf50 {place}", mtf50, "cycles/px", basis))
        quantities.append(_mean(f"rise {place}", rise, "px", basis))
    return quantities


def _mean(name: str, measured: list[tuple[float, float]], unit: str, basis: str) -> Quantity:
    """Mean of measured values, each with its sigma; its own sigma is of their noise or scatter."""
    values, sigmas = np.array(measured).T
    scatter = float(values.std(ddof=1)) if len(values) > 1 else 0.0
    sigma = max(scatter, float(np.sqrt(np.mean(sigmas**2)))) / np.sqrt(len(values))
    return Quantity(name, float(values.mean()), float(sigma), unit, basis)


# Curves of point spread and lateral color over the image radius, as parameters of a camera.


KNOTS = 7  # rows of the point spread
SIGNIFICANT = 2.0  # least width, in its standard deviations
SYSTEMATIC, SYSTEMATIC_PX2 = 0.005, 0.0015  # of a variance: error of an edge without noise
SYSTEMATIC_PX = 0.003  # of a shift, likewise
MIN_RADIAL = 0.3  # cosine between normal and radius of an edge that shows lateral color
MIN_COLOR_EDGES = 6
MIN_FIELD = 0.6  # share of the largest possible radius
DIGITS = 4  # of the keys: their errors depend on each other, and rounding would add its own


@dataclass(frozen=True, eq=False)
class FieldCurves:
    """Point spread and lateral color over the field (None: not determined), and quantities."""

    radii_px: Floats  # (edges,) image radius of each edge
    point_spread: PointSpread | None
    chromatic_aberration: ChromaticAberration | None
    quantities: list[Quantity]
    unobservable: list[Unobservable]  # not determined by the edges


def field_curves(
    edges: Sequence[EdgeSharpness], size_px: tuple[int, int], center_px: tuple[float, float]
) -> FieldCurves:
    """Fit point spread and lateral color to edges, at least one, in images of one size.

    Radii are about `center_px`, (u, v).
    """
    unit_px = ImageGeometry(*size_px, center_px).radius_unit_px
    offsets = np.array([edge.center_px for edge in edges]) - center_px
    radii_px = np.hypot(offsets[:, 0], offsets[:, 1])
    normals = np.array([edge.normal for edge in edges])
    outward = offsets / np.maximum(radii_px, 1e-9)[:, None]
    radial = (outward * normals).sum(axis=1)
    curves = FieldCurves(radii_px, None, None, [], [])  # both fits append to its lists
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

    Edges have an image radius (edges,), whose unit is `unit_px`, and the squared cosine (edges,)
    between their normal and the radius.
    """
    variances = np.array([edge.variance_px2 for edge in edges])
    sigmas = np.array([edge.variance_sigma_px2 for edge in edges])
    sigmas = np.hypot(sigmas, SYSTEMATIC_PX2 + SYSTEMATIC * np.abs(variances))
    isotropic = float(radial_share.std()) < MIN_SPREAD
    if isotropic:
        reason = "all edges have similar angles to the radius: add a board turned by 45°"
        name = "difference of radial and tangential width"
        curves.unobservable.append(Unobservable(name, reason))
    radii = radii_px / unit_px

    def design(degree: int) -> Floats:
        return spread_rows(radii, radial_share, degree, isotropic)

    degrees = range(MAX_SPREAD_DEGREE + 1) if np.ptp(radii) > 0.1 else range(1)
    curve = fit_curve(design, variances, sigmas, degrees)
    knots = KNOTS if curve.degree > 0 else 1
    at_px = np.linspace(radii_px.min(), radii_px.max(), knots) if knots > 1 else np.zeros(1)
    rows = []  # widths (knots,) along and across the radius, with their standard deviations
    for share in (1.0, 0.0):
        shares = np.full_like(at_px, share)
        fitted, errors = curve.at(spread_rows(at_px / unit_px, shares, curve.degree, isotropic))
        widths = np.sqrt(np.maximum(fitted, 0.0))
        # by the root's derivative, bounded near zero
        errors = np.minimum(errors / (2.0 * np.maximum(widths, 1e-9)), np.sqrt(errors))
        rows.append((widths, errors))
    if all((widths < SIGNIFICANT * errors).all() for widths, errors in rows):
        reason = "the edges are as sharp as the pixels allow: the optics' blur cannot be measured"
        curves.unobservable.append(Unobservable("point_spread", reason))
        return None
    basis = f"{int(curve.used.sum())} edges, degree {curve.degree}"
    for name, (widths, errors) in zip(("radial", "tangential"), rows, strict=True):
        for radius, width, error in zip(at_px, widths, errors, strict=True):
            place = f"{name} {radius:.0f} px" if knots > 1 else name
            curves.quantities.append(Quantity(place, float(width), float(error), "px", basis))
    table = np.stack((at_px, rows[0][0], rows[1][0]), axis=-1).round(DIGITS)
    table[:, 0] = table[:, 0].round(1)
    table[:, 1:] = np.minimum(table[:, 1:], MAX_WIDTH_PX)
    return PointSpread(tuple((row[0], row[1], row[2]) for row in table.tolist()))


def _lateral_color(
    edges: Sequence[EdgeSharpness],
    radii_px: Floats,
    radial: Floats,
    unit_px: float,
    curves: FieldCurves,
) -> ChromaticAberration | None:
    """Fit the offsets of red and blue; None: too few edges. Adds quantities to `curves`.

    Edges have an image radius (edges,), whose unit is `unit_px`, and the cosine (edges,) between
    their normal and the radius.
    """
    shifts = np.array([edge.shifts_px for edge in edges])
    sigmas = np.hypot([edge.shift_sigmas_px for edge in edges], SYSTEMATIC_PX)
    usable = (np.abs(radial) > MIN_RADIAL) & np.isfinite(shifts).all(axis=1)
    if usable.sum() < MIN_COLOR_EDGES:
        reason = f"{int(usable.sum())} edges across the radius, expected {MIN_COLOR_EDGES}"
        if not np.isfinite(shifts).any():
            reason = "the images have one channel: save demosaicked linear images with three"
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
            place = f"{name} {radius:.0f} px"
            curves.quantities.append(Quantity(place, offset, sigma, "px", basis))
    return ChromaticAberration(red_offsets_px=coefficients[0], blue_offsets_px=coefficients[1])


# One curve over the image radius, fitted to many edges without the outliers.


MAX_SPREAD_DEGREE, MAX_COLOR_DEGREE = 4, 3
MIN_EDGES_PER_TERM = 3
MIN_SPREAD = 0.15  # of the squared cosines: less does not tell radial from tangential
_OUTLIER = 4.0  # robust standard deviations
_ROUNDS = 5

Design = Callable[[int], Floats]  # (n, terms) by the degree


@dataclass(frozen=True, eq=False)
class Curve:
    """Linear combination of basis functions."""

    degree: int  # degree of the polynomial, chosen by Akaike's information criterion
    coefficients: Floats  # (terms,) coefficients of the least-squares fit
    # (terms, terms) covariance of the coefficients, with the scatter of the edges
    covariance: Floats
    used: Bools  # (n,) False: an outlier

    def at(self, design: Floats) -> tuple[Floats, Floats]:
        """Values (n,) and standard deviations (n,) of the curve for basis functions (n, terms)."""
        variance = np.einsum("ij,jk,ik->i", design, self.covariance, design)
        return design @ self.coefficients, np.sqrt(np.maximum(variance, 0.0))


def fit_curve(design: Design, values: Floats, sigmas: Floats, degrees: Sequence[int]) -> Curve:
    """Fit a curve to values (n,) with standard deviations `sigmas` (n,), without outliers.

    `design` gives the basis functions (n, terms) of a degree. Of the ascending degrees, all but the
    first need three values per term.
    """
    count = len(values)
    usable = [
        degree
        for degree in degrees
        if degree == degrees[0] or MIN_EDGES_PER_TERM * design(degree).shape[1] <= count
    ]
    rows, used = design(usable[-1]), np.ones(count, dtype=np.bool_)
    for _ in range(_ROUNDS):
        scaled = (values - rows @ _solve(rows, values, sigmas, used)) / sigmas
        middle = float(np.median(scaled[used]))
        spread = 1.4826 * float(np.median(np.abs(scaled[used] - middle)))
        used = np.abs(scaled - middle) <= _OUTLIER * max(spread, 1.0)
    curves = [_least_squares(degree, design(degree), values, sigmas, used) for degree in usable]
    return min(curves, key=lambda scored: scored[0])[1]


def _least_squares(
    degree: int, rows: Floats, values: Floats, sigmas: Floats, used: Bools
) -> tuple[float, Curve]:
    """Akaike's information criterion and the fitted curve of one degree."""
    coefficients = _solve(rows, values, sigmas, used)
    chi2 = float((((values - rows @ coefficients) / sigmas)[used] ** 2).sum())
    terms, number = rows.shape[1], int(used.sum())
    score = number * float(np.log(max(chi2, 1e-12) / number)) + 2.0 * terms
    excess = max(1.0, chi2 / max(number - terms, 1))
    weighted = rows[used] / sigmas[used, None]
    covariance = np.asarray(excess * np.linalg.pinv(weighted.T @ weighted), dtype=np.float64)
    return score, Curve(degree, coefficients, covariance, used)


def _solve(rows: Floats, values: Floats, sigmas: Floats, used: Bools) -> Floats:
    weights = used / sigmas
    solution = np.linalg.lstsq(rows * weights[:, None], values * weights, rcond=None)[0]
    return np.asarray(solution, dtype=np.float64)


def spread_rows(radii: Floats, radial_share: Floats, degree: int, isotropic: bool) -> Floats:
    """Basis functions (n, terms) of the variance of the point spread along the edges' normals.

    The radial and the tangential variance are polynomials of the relative radius (n,), equal in the
    center, or everywhere if isotropic. The share is the squared cosine of normal and radius.
    """
    columns = [np.ones_like(radii)]
    for power in range(1, degree + 1):
        if isotropic:
            columns.append(radii**power)
        else:
            columns += [radial_share * radii**power, (1.0 - radial_share) * radii**power]
    return np.stack(columns, axis=-1)


def offset_rows(radii: Floats, radial: Floats, degree: int) -> Floats:
    """Basis functions (n, degree) of the shift along edges' normals, for a radial offset.

    The offset is a polynomial of the relative radii (n,) that is 0 in the center; `radial` (n,) is
    the cosine between normal and radius.
    """
    return np.stack([radial * radii**power for power in range(1, degree + 1)], axis=-1)
