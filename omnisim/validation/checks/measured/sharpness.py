"""Sharpness measured from edges with blur in closed form, and from images of the measured lens."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from omnisim.measurement.sharpness import MeasuredSharpness, measure_sharpness
from omnisim.rendering.camera.degradations.image_geometry import ImageGeometry
from omnisim.report.measure import Measure
from omnisim.report.report import ResultTable, Section
from omnisim.validation.analytic_edges import gaussian, true_mtf50
from omnisim.validation.analytic_lens import AnalyticLens
from omnisim.validation.fixture import Fixture

LENSES, QUICK_LENSES = 12, 2
CHARTS, TWIN_CHARTS, NOISE = 3, 2, 0.005
MTF50_BOUND, TWIN_MTF50_BOUND, COLOR_BOUND_PX = 0.03, 0.05, 0.02
SHARP_PX = 1e-3
_RADII = np.linspace(0.1, 1.45, 10)  # in half of the shorter side; the corner is at 1.67


def check(fixture: Fixture, title: str) -> Section:
    """Measure random lenses, then images by the measured lenses; compare both with the formulas."""
    count = QUICK_LENSES if fixture.is_quick else LENSES
    rows, sigmas = [], []
    worst = np.zeros(4)
    for seed in range(count):
        lens = AnalyticLens.drawn(seed)
        charts = [lens.chart(NOISE, 100 * seed + number) for number in range(CHARTS)]
        measured = measure_sharpness(charts)
        again = measure_sharpness(twin_charts(measured, lens))
        errors = np.array([*largest_errors(measured, lens), *largest_errors(again, lens)])
        sigmas += normalized_errors(measured, lens)
        worst = np.maximum(worst, errors)
        cells = [
            f"{100.0 * share:.2f} %, {offset_px:.4f} px"
            for share, offset_px in (errors[:2], errors[2:])
        ]
        rows.append((str(seed), str(len(measured.edges)), *cells))
    largest = worst.tolist()
    within = float(np.mean(np.abs(sigmas) < 2.0))
    columns = ("lens", "edges", "MTF50, lateral color", "those of the twin")
    return Section(
        title,
        f"Curves measured by `omnisim measure sharpness` for {count} random lenses, against their "
        "formulas, up to 87 % of the field. The lenses have Gaussian point spreads, with radial "
        "and tangential widths that grow with the image radius, and offsets of red and blue. Each "
        f"has {CHARTS} images of 960 × 720 px with one slanted edge per patch, in closed form, and "
        f"noise of {100.0 * NOISE:g} % of white. The twin's images are ideal images with the "
        "measured degradations; they are measured again.",
        (
            Measure("MTF50 over the field, largest error", 100.0 * largest[0], "%",
                    100.0 * MTF50_BOUND),
            Measure("lateral color, largest error", largest[1], "px", COLOR_BOUND_PX),
            Measure("MTF50 of the twin, largest error", 100.0 * largest[2], "%",
                    100.0 * TWIN_MTF50_BOUND),
            Measure("lateral color of the twin, largest error", largest[3], "px", COLOR_BOUND_PX),
            Measure("widths within two standard deviations", 100.0 * within, "%"),
        ),
        (ResultTable("Largest errors of each lens", columns, tuple(rows)),),
    )  # fmt: skip


def largest_errors(measured: MeasuredSharpness, lens: AnalyticLens) -> tuple[float, float]:
    """Maximum relative error of MTF50 over the field, and maximum error in px of a color's offset.

    Both are infinite if the point spread or the chromatic aberration was not measured.
    """
    color, spread = measured.chromatic_aberration, measured.point_spread
    if color is None or spread is None:
        return np.inf, np.inf
    radii_px, *widths_px = np.array(spread.widths_px).T
    shares = [
        _mtf50(float(np.interp(radius * lens.unit_px, radii_px, widths))) / _mtf50(width) - 1.0
        for radius in _RADII.tolist()
        for widths, width in zip(widths_px, _widths_px(lens, radius), strict=True)
    ]
    offsets = [
        np.polynomial.polynomial.polyval(_RADII, (0.0, *found))
        - np.polynomial.polynomial.polyval(_RADII, (0.0, *true))
        for found, true in (
            (color.red_offsets_px, lens.red_px),
            (color.blue_offsets_px, lens.blue_px),
        )
    ]
    return float(np.abs(shares).max()), float(np.abs(offsets).max())


def normalized_errors(measured: MeasuredSharpness, lens: AnalyticLens) -> list[float]:
    """Errors of the measured widths, each divided by its standard deviation."""
    errors = []
    for one in measured.quantities:
        direction, _, radius = one.name.removesuffix(" px").partition(" ")
        if direction in ("radial", "tangential") and radius:
            true = _widths_px(lens, float(radius) / lens.unit_px)
            errors.append((one.value - true[direction == "tangential"]) / one.sigma)
    return errors


def twin_charts(measured: MeasuredSharpness, lens: AnalyticLens) -> list[NDArray[np.float32]]:
    """Images (height, width, 3) of an ideal lens with the measured degradations."""
    ideal = AnalyticLens(lens.size_px, (SHARP_PX,), (SHARP_PX,), (), ())
    geometry = ImageGeometry(*lens.size_px, measured.center_px)
    images = []
    for seed in range(TWIN_CHARTS):
        image = np.ones((geometry.height_px, geometry.width_px, 4), dtype=np.float32)
        image[..., :3] = ideal.chart(seed=seed) / 65535.0
        for effect in (measured.point_spread, measured.chromatic_aberration):
            image = image if effect is None else effect.apply(image, geometry)
        images.append(image[..., :3])
    return images


def _widths_px(lens: AnalyticLens, radius: float) -> tuple[float, float]:
    """True radial and tangential standard deviations at a radius, relative to `lens.unit_px`."""
    radial, tangential = (
        float(np.polynomial.polynomial.polyval(radius, widths))
        for widths in (lens.radial_px, lens.tangential_px)
    )
    return radial, tangential


def _mtf50(width_px: float) -> float:
    return true_mtf50(gaussian(max(width_px, SHARP_PX)), 0.0)
