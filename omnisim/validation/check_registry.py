"""Checks of `omnisim validate`, in the order of the report; each is imported when it runs."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING, Any

from omnisim.core.errors import OmnisimError

if TYPE_CHECKING:  # slow to import
    from omnisim.report.report import Report, Section
    from omnisim.validation.fixture import Fixture


@dataclass(frozen=True)
class Check:
    """Comparison of images with equations or an independent oracle."""

    key: str  # short name, in `report.json` and on the command line
    title: str  # heading
    # "module.function" in `omnisim.validation.checks`, imported when the check runs
    entry_point: str
    # required modules of the extra `oracles`, as "module" or "module.attribute"
    oracles: tuple[str, ...] = ()
    is_quick: bool = True  # part of the quick report

    def skip_reason(self) -> str:
        """Unusable oracles, with reason and remedy; empty: all are usable."""
        from omnisim.validation.oracles import import_failure

        return "; ".join(filter(None, map(import_failure, self.oracles)))

    def run(self, fixture: Fixture) -> Section:
        """Run the check, and return its section of the report."""
        module, _, function = self.entry_point.rpartition(".")
        check = getattr(import_module(f"omnisim.validation.checks.{module}"), function)
        section: Section = check(fixture, self.title)
        return dataclasses.replace(section, key=self.key)


_NOT_QUICK = False
CHECKS = (
    Check("rings", "Fig. 7 and Eq. 2: where the image shows an angle", "paper_mirror.check_rings"),
    Check("polygons", "Fig. 8 and 9: how many polygons the mirror needs",
          "paper_mirror.check_polygons"),
    Check("viewpoint", "Single viewpoint", "paper_mirror.check_viewpoint"),
    Check("path-tracer", "A physical mirror, traced by another renderer",
          "traced_images.check_mirror", ("mitsuba",), _NOT_QUICK),
    Check("second-rasterizer", "A second rasterizer", "other_renderers.check_rasterizer",
          ("pyrender",)),
    Check("materials", "Metal and gloss, traced by another renderer", "materials.check",
          ("mitsuba",), _NOT_QUICK),
    Check("shadows", "Lamps and shadows, traced by another renderer", "lit_scenes.check_shadows",
          ("mitsuba",), _NOT_QUICK),
    Check("baked", "Baked light, traced by another renderer", "lit_scenes.check_baked",
          ("mitsuba", "embreex", "xatlas"), _NOT_QUICK),
    Check("reflections", "Mirrors, gloss and glass, traced by another renderer",
          "traced_images.check_reflections", ("mitsuba", "embreex"), _NOT_QUICK),
    Check("arcade", "Glass, mirrors and metal in a scene, traced by another renderer",
          "traced_images.check_arcade", ("mitsuba", "embreex"), _NOT_QUICK),
    Check("rays", "A ray caster", "other_renderers.check_rays", ("embreex",)),
    Check("quality", "Image quality and shimmer", "other_renderers.check_quality"),
    Check("markers", "Markers through the whole pipeline", "calibration.check_markers"),
    Check("omnidir", "A calibration library", "calibration.check_omnidir", ("cv2.omnidir",)),
    Check("boards", "Exported calibrations, read by OpenCV", "calibration.check_boards",
          ("cv2.omnidir",)),
    Check("twin", "Cameras measured from boards", "measured.board_measurement.check", ("cv2",)),
    Check("noise", "Noise measured from frames",
          "measured.response_and_readout.check_noise", ("emva1288",)),
    Check("sharpness", "Sharpness measured from edges", "measured.sharpness.check"),
    Check("response", "Response, vignetting and readout measured from frames",
          "measured.response_and_readout.check_response", ("cv2",)),
    Check("orientation", "Orientation", "orientation.check_orientation"),
    Check("unwarping", "Unwarped views", "orientation.check_unwarping"),
    Check("optics", "Any optics: rays, caustics and pixels", "optics.check_rays"),
    Check("optics-path-tracer", "Any optics: real mirrors and windows, traced by another renderer",
          "optics_images.check", ("mitsuba",), _NOT_QUICK),
    Check("optics-triangles", "Any optics: near objects",
          "optics.check_triangles", ("embreex",)),
    Check("optics-calibration", "Any optics: calibrations from chessboards",
          "optics.check_calibration", ("cv2.omnidir",)),
)  # fmt: skip


def run_checks(fixture: Fixture, checks: Sequence[Check]) -> Iterator[Section]:
    """Run checks in sequence; a broken oracle fails only its own check.

    Raises:
        OmnisimError: no OpenGL, or another error that a user can fix.
        Exception: a defect in a check without oracles.
    """
    from omnisim.report.report import Section

    for check in checks:
        section = Section(check.title, key=check.key, skipped=check.skip_reason())
        if section.skipped:
            yield section
            continue
        start = time.perf_counter()
        try:
            section = check.run(fixture)
        except OmnisimError:
            raise
        except Exception as broken:
            if not check.oracles:
                raise  # a defect of omnisim
            message = " ".join(f"{type(broken).__name__}: {broken}".split())
            section = dataclasses.replace(section, failure=message[:300])
        yield dataclasses.replace(section, seconds=time.perf_counter() - start)


def make_report(sections: Sequence[Section], is_quick: bool, machine: dict[str, Any]) -> Report:
    """Report of the finished checks, with notices about checks that were left out or skipped."""
    from omnisim.report.report import Report

    run = {section.key for section in sections}
    left_out = [check.title for check in CHECKS if check.key not in run]
    notices = ["Quick report: smaller images and fewer samples."] if is_quick else []
    notices += [f"Left out: {'; '.join(left_out)}."] if left_out else []
    notices += [f"Not checked: {part.title}: {part.skipped}" for part in sections if part.skipped]
    seconds = round(sum(section.seconds or 0.0 for section in sections), 1)
    facts = {"quick": is_quick, "left_out": left_out, "seconds": seconds}
    text = "Images against the paper's equations and independent oracles."
    return Report("Validation", text, sections, facts, notices, machine)
