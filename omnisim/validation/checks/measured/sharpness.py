"""Sharpness measured from edges with blur in closed form, and from images of the measured lens."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.special import ndtr

from omnisim.core.arrays import Floats, Floats32, Ints
from omnisim.measurement.sharpness import MeasuredSharpness, measure_sharpness
from omnisim.rendering.camera.degradations.image_geometry import ImageGeometry
from omnisim.report.report import Measure, ResultTable, Section
from omnisim.validation.fixture import Fixture

LENSES, QUICK_LENSES = 12, 2
CHARTS, TWIN_CHARTS, NOISE = 3, 2, 0.005
MTF50_BOUND, TWIN_MTF50_BOUND, COLOR_BOUND_PX = 0.03, 0.05, 0.02
SHARP_PX = 1e-3
_RADII = np.linspace(0.1, 1.45, 10)  # in half of the shorter side; the corner is at 1.67
PATCH_PX = 60
DARK, BRIGHT = 0.08, 0.75


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
    polyval = np.polynomial.polynomial.polyval
    pairs = (color.red_offsets_px, lens.red_px), (color.blue_offsets_px, lens.blue_px)
    offsets = [
        polyval(_RADII, (0.0, *measured_px)) - polyval(_RADII, (0.0, *true_px))
        for measured_px, true_px in pairs
    ]
    return float(np.abs(shares).max()), float(np.abs(offsets).max())


def normalized_errors(measured: MeasuredSharpness, lens: AnalyticLens) -> list[float]:
    """Errors of the measured widths, each divided by its standard deviation."""
    errors = []
    for quantity in measured.quantities:
        direction, _, radius = quantity.name.removesuffix(" px").partition(" ")
        if direction in ("radial", "tangential") and radius:
            true = _widths_px(lens, float(radius) / lens.unit_px)
            errors.append((quantity.value - true[direction == "tangential"]) / quantity.sigma)
    return errors


def twin_charts(measured: MeasuredSharpness, lens: AnalyticLens) -> list[Floats32]:
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


@dataclass(frozen=True)
class AnalyticLens:
    """Lens whose point spread is a Gaussian, with standard deviations that depend on the radius.

    Each quantity is a polynomial in the image radius divided by half of the shorter side, given by
    its coefficients in ascending order.
    """

    size_px: tuple[int, int]  # width and height of the image
    # standard deviations of the Gaussian, from the constant term on; the two constants are equal
    radial_px: tuple[float, ...]
    tangential_px: tuple[float, ...]
    # radial offsets of red and blue from green, from the linear term on
    red_px: tuple[float, ...]
    blue_px: tuple[float, ...]

    @classmethod
    def drawn(cls, seed: int, size_px: tuple[int, int] = (960, 720)) -> AnalyticLens:
        """Lens with random coefficients: sharp in the center, softer outside."""
        random = np.random.default_rng(seed)
        center = random.uniform(0.35, 0.7)
        widths = [(center, random.uniform(0.0, 0.3), random.uniform(0.0, 0.5)) for _ in range(2)]
        colors = [tuple(random.uniform(-0.6, 0.6, 3).tolist()) for _ in range(2)]
        return cls(size_px, widths[0], widths[1], colors[0], colors[1])

    @property
    def center_px(self) -> Floats:
        """(u, v) of the optical axis."""
        return 0.5 * (np.array(self.size_px) - 1.0)

    @property
    def unit_px(self) -> float:
        """Half of the shorter side."""
        return 0.5 * min(self.size_px)

    def widths_px(self, offsets_px: Floats, normal: Floats) -> Floats:
        """Standard deviations (...) of the point spread along a unit vector (2,).

        Args:
            offsets_px: (..., 2) offsets from the center.
        """
        radii = np.hypot(offsets_px[..., 0], offsets_px[..., 1])
        share = (offsets_px @ normal / np.maximum(radii, 1e-9)) ** 2
        radial, tangential = (
            np.polynomial.polynomial.polyval(radii / self.unit_px, widths)
            for widths in (self.radial_px, self.tangential_px)
        )
        return np.sqrt(share * radial**2 + (1.0 - share) * tangential**2)

    def chart(self, noise: float = 0.0, seed: int = 0) -> NDArray[np.uint16]:
        """Linear 16-bit image (height, width, 3) of patches with one edge each, randomly directed.

        Args:
            noise: standard deviation, as a share of white.
            seed: seed of directions, positions and noise.
        """
        random = np.random.default_rng(seed)
        width, height = self.size_px
        image = np.zeros((height, width, 3))
        for top in range(0, height, PATCH_PX):
            for left in range(0, width, PATCH_PX):
                patch = np.s_[top : top + PATCH_PX, left : left + PATCH_PX]
                angle_deg = 90.0 * random.integers(4) + random.uniform(4.0, 86.0)
                point = 0.5 * (PATCH_PX - 1) + random.uniform(-0.5, 0.5, 2)
                image[patch] = self._patch(angle_deg, point, np.array((left, top)))
        image += noise * random.normal(size=image.shape)
        return np.rint(65535.0 * image.clip(0.0, 1.0)).astype(np.uint16)

    def _patch(self, angle_deg: float, point_px: Floats, corner_px: Ints) -> Floats:
        """Linear colors (PATCH_PX, PATCH_PX, 3) of a patch with an edge.

        The edge passes through `point_px`, relative to the patch's first pixel `corner_px`; its
        normal points in direction `angle_deg`, from +u to +v.
        """
        angle = np.radians(angle_deg)
        normal = np.array((np.cos(angle), np.sin(angle)))
        pixels = np.stack(np.meshgrid(*(np.arange(PATCH_PX),) * 2), axis=-1)
        offsets = pixels + corner_px - self.center_px
        distances = (pixels - point_px) @ normal
        radii = np.hypot(offsets[..., 0], offsets[..., 1])
        radial = offsets @ normal / np.maximum(radii, 1e-9)
        widths = self.widths_px(offsets, normal)
        colors = []
        for coefficients in (self.red_px, (), self.blue_px):
            moved = np.polynomial.polynomial.polyval(radii / self.unit_px, (0.0, *coefficients))
            colors.append(_level(distances - moved * radial, widths, normal))
        return DARK + (BRIGHT - DARK) * np.stack(colors, axis=-1)


def _level(distances_px: Floats, widths_px: Floats, normal: Floats) -> Floats:
    """Levels (...) from 0 to 1 of an edge blurred by a Gaussian, averaged over square pixels."""
    first, second = 0.5 * np.abs(normal)
    total = np.zeros_like(distances_px)
    signs = ((1.0, first + second), (-1.0, first - second), (-1.0, second - first))
    for sign, offset in (*signs, (1.0, -first - second)):
        x = (distances_px + offset) / widths_px
        density = np.exp(-0.5 * x**2) / np.sqrt(2.0 * np.pi)
        total += sign * 0.5 * widths_px**2 * ((x**2 + 1.0) * ndtr(x) + x * density)
    return total / (4.0 * first * second)


@dataclass(frozen=True)
class LineSpread:
    """Line spread along the normal of an edge."""

    # function from the distance in px to the unnormalized density
    density: Callable[[Floats], Floats]
    # function from the frequency in cycles per px to the Fourier transform, 1 at 0
    transfer: Callable[[float], float]


def gaussian(sigma_px: float) -> LineSpread:
    """Line spread of a Gaussian blur."""
    return LineSpread(
        lambda x: np.exp(-0.5 * (x / sigma_px) ** 2),
        lambda f: float(np.exp(-2.0 * (np.pi * sigma_px * f) ** 2)),
    )


def true_mtf50(spread: LineSpread, angle_deg: float) -> float:
    """Frequency in cycles per px, along the normal, at which spread and pixel halve contrast."""
    angle = np.radians(angle_deg)

    def excess(frequency: float) -> float:
        pixel = np.sinc(frequency * np.cos(angle)) * np.sinc(frequency * np.sin(angle))
        return float(pixel) * spread.transfer(frequency) - 0.5

    frequencies = np.arange(0.005, 0.9, 0.005).tolist()
    first = next(frequency for frequency in frequencies if excess(frequency) < 0.0)
    return float(brentq(excess, first - 0.005, first))
