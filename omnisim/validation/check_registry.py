"""Checks of `omnisim validate`, in the order of the report; each is imported when it runs."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:  # slow to import
    from omnisim.report.report import Section
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
    Check("quality", "Quality of the image, and shimmer", "other_renderers.check_quality"),
    Check("markers", "Markers through the whole pipeline", "calibration.check_markers"),
    Check("omnidir", "A calibration library", "calibration.check_omnidir", ("cv2.omnidir",)),
    Check("boards", "Calibration files in the hands of others", "calibration.check_boards",
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
    Check("optics-triangles", "Any optics: things a hand's breadth away",
          "optics.check_triangles", ("embreex",)),
    Check("optics-calibration", "Any optics: calibrations from chessboards",
          "optics.check_calibration", ("cv2.omnidir",)),
)  # fmt: skip
