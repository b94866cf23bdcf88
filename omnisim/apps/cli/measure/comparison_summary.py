"""Summary of a camera's comparison with its twin: text, and the section of the report."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from omnisim.apps.cli.console import pluralize
from omnisim.measurement.comparison import Comparison
from omnisim.rendering.camera.degradations import Degradation

if TYPE_CHECKING:
    from omnisim.report.measure import Measure
    from omnisim.report.report import ResultTable, Section

_SHOWN = 6  # images in the report
_BIAS_PX, _LEVELS, _RISE_PERCENT, _NOISE = 0.05, 4.0, 15.0, 0.5


@dataclass(frozen=True)
class Subject:
    """Content of the images.

    Attributes:
        text: description of the comparison.
        patches: name of the patches whose gray levels are compared.
        max_offset_px: offset beyond which a corner counts as lost.
    """

    text: str
    patches: str
    max_offset_px: float


@dataclass(frozen=True, eq=False)
class ComparisonSummary:
    """Comparison with the words that describe it.

    Attributes:
        comparison: errors of the twin.
        subject: content of the images.
        degradation: effects in the twin's sensor file, of which blur and noise are compared.
        brighter_ev: light of the images over that of the twin's, EV; None: fitted.
    """

    comparison: Comparison
    subject: Subject
    degradation: Degradation
    brighter_ev: float | None = None

    @property
    def level_error(self) -> float:
        """90th percentile of the absolute differences of gray levels; NaN: no even patch."""
        errors = np.abs(self.comparison.level_errors)
        return float(np.percentile(errors, 90.0)) if len(errors) else math.nan

    @property
    def rise_error(self) -> float:
        """Maximum relative difference of the edge rise over the rings; NaN: no clear edge."""
        ratios = [ring.twin_rise_px / ring.rise_px - 1.0 for ring in self.comparison.rings]
        return max((abs(ratio) for ratio in ratios if math.isfinite(ratio)), default=math.nan)

    @property
    def noise_error(self) -> float:
        """Maximum difference of the noise over the gray levels; NaN: too few even blocks."""
        noise = self.comparison.noise
        return max((abs(one.twin_noise - one.noise) for one in noise), default=math.nan)

    @property
    def measures(self) -> tuple[Measure, ...]:
        """Errors with their bounds; those of blur and noise need their part of the sensor file."""
        from omnisim.report.measure import Measure

        made, patches = self.degradation, self.subject.patches
        level, rise, noise = self.level_error, self.rise_error, self.noise_error
        no_level = "" if math.isfinite(level) else f"no {patches}"
        no_rise = "" if math.isfinite(rise) else "no edge is long enough"
        if made.point_spread is None and made.defocus is None:
            no_rise = "the sensor file has no blur"
        no_noise = "the sensor file has no noise" if made.noise is None else ""
        measures = [
            Measure(
                "largest bias of corners, by ring", self.comparison.bias_px, "px", _BIAS_PX
            ),
            Measure(
                f"gray levels of 90 % of the {patches}", level, "of 255", _LEVELS,
                unmeasured=no_level,
            ),
            Measure(
                "10–90 % rise of edges, by ring", 100.0 * rise, "%", _RISE_PERCENT,
                unmeasured=no_rise,
            ),
        ]  # fmt: skip
        if math.isfinite(noise):
            measures.append(
                Measure("noise, by gray level", noise, "gray levels", _NOISE, unmeasured=no_noise)
            )
        if self.brighter_ev is not None:
            name = "light of the images over the twin's, median"
            measures.append(Measure(name, self.brighter_ev, "EV"))
        return tuple(measures)

    def text(self) -> str:
        """Line of the most important numbers, and what they miss or do not check."""
        rise, noise, ev = self.rise_error, self.noise_error, self.brighter_ev
        parts = [
            f"{pluralize(len(self.comparison.images), 'image')}: corners found again with a bias "
            f"of {self.comparison.bias_px:.3f} px at most by ring, {self.comparison.lost} lost",
            f"gray levels within {self.level_error:.1f} of 255 for 90 % of the "
            f"{self.subject.patches}"
            if math.isfinite(self.level_error)
            else f"no {self.subject.patches} to compare gray levels",
            f"edges within {100.0 * rise:.0f} %" if math.isfinite(rise) else "no edge long enough",
        ]
        if math.isfinite(noise):
            parts.append(f"noise within {noise:.2f} gray levels")
        if ev is not None and math.isfinite(ev):
            parts.append(f"images brighter than the twin's by {ev:+z.2f} EV")
        missed = [one.name for one in self.measures if one.passed is False]
        unmeasured = [f"{one.name} ({one.unmeasured})" for one in self.measures if one.unmeasured]
        lists = (("missed", missed), ("not measured", unmeasured))
        return "; ".join(
            parts + [f"{title}: {', '.join(names)}" for title, names in lists if names]
        )

    def section(self) -> Section:
        """Section of the report."""
        from omnisim.plots.twin_plots import edge_figure, noise_figure, sheet_figure
        from omnisim.report.report import CaptionedFigure, Section

        comparison = self.comparison
        step = max(1, len(comparison.images) // _SHOWN)
        shown = comparison.images[::step][:_SHOWN]
        figures = [
            CaptionedFigure(
                "images", sheet_figure(shown), "Images, the twin's, and twin minus image"
            ),
            CaptionedFigure("edges", edge_figure(comparison), "Corners and edges over the field"),
        ]
        tables = [self._rings()]
        if comparison.noise:
            caption = "Noise by gray level, with fine texture, in even blocks of images and twin"
            figures.append(CaptionedFigure("noise-levels", noise_figure(comparison), caption))
        return Section(
            "The camera beside its twin",
            self.subject.text,
            measures=self.measures,
            tables=tuple(tables),
            figures=tuple(figures),
        )

    def _rings(self) -> ResultTable:
        from omnisim.report.report import ResultTable

        columns = (
            "up to px",
            "corners",
            "lost",
            "bias along the radius",
            "bias across it",
            "RMS",
            "edge rise",
            "twin's",
        )
        rows = tuple(
            (
                f"{ring.radius_px:.0f}",
                str(ring.corners),
                str(ring.lost),
                _number(ring.bias_px[0], "+z.3f"),
                _number(ring.bias_px[1], "+z.3f"),
                _number(ring.rms_px, ".3f"),
                _number(ring.rise_px, ".2f"),
                _number(ring.twin_rise_px, ".2f"),
            )
            for ring in self.comparison.rings
        )
        limit = self.subject.max_offset_px
        caption = f"Rings of the image, px. Lost: more than {limit:g} px off, or not found."
        return ResultTable(caption, columns, rows)


def _number(value: float, form: str) -> str:
    return format(value, form) if math.isfinite(value) else "–"
