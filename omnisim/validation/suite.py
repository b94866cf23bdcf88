"""The checks of `omnisim validate`, in the order of the report."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import Any

from omnisim.core.errors import OmnisimError
from omnisim.validation.fixture import Fixture
from omnisim.validation.oracles import import_failure
from omnisim.validation.report.report import Report, Section


@dataclass(frozen=True)
class Check:
    """A comparison of images with equations or an independent oracle.

    Attributes:
        key: short name, in `report.json` and on the command line.
        title: heading.
        entry_point: module in `omnisim.validation.checks` and function in it; imported when it
            runs.
        oracles: required modules of the extra `oracles`, as "module" or "module.attribute".
        is_quick: part of the quick report.
    """

    key: str
    title: str
    entry_point: str
    oracles: tuple[str, ...] = ()
    is_quick: bool = True

    def skip_reason(self) -> str:
        """Oracles that cannot be used, why, and what to do; empty: all can."""
        return "; ".join(filter(None, map(import_failure, self.oracles)))

    def run(self, fixture: Fixture) -> Section:
        """Measure, and compare with the bounds."""
        module, _, function = self.entry_point.partition(".")
        check = getattr(import_module(f"omnisim.validation.checks.{module}"), function)
        section: Section = check(fixture, self.title)
        return dataclasses.replace(section, key=self.key)


CHECKS = (
    Check("rings", "Fig. 7 and Eq. 2: where the image shows an angle", "rings.check"),
    Check("polygons", "Fig. 8 and 9: how many polygons the mirror needs", "polygons.check"),
    Check("viewpoint", "Single viewpoint", "viewpoint.check"),
    Check(
        "path-tracer",
        "A physical mirror, traced by another renderer",
        "path_tracer.check",
        oracles=("mitsuba",),
        is_quick=False,
    ),
    Check(
        "second-rasterizer",
        "A second rasterizer",
        "second_rasterizer.check",
        oracles=("pyrender",),
    ),
    Check(
        "materials",
        "Metal and gloss, traced by another renderer",
        "materials.check",
        oracles=("mitsuba",),
        is_quick=False,
    ),
    Check(
        "shadows",
        "Lamps and shadows, traced by another renderer",
        "shadows.check",
        oracles=("mitsuba",),
        is_quick=False,
    ),
    Check(
        "baked",
        "Baked light, traced by another renderer",
        "baked.check",
        oracles=("mitsuba", "embreex", "xatlas"),
        is_quick=False,
    ),
    Check("rays", "A ray caster", "ray_caster.check", oracles=("embreex",)),
    Check("quality", "Quality of the image, and shimmer", "image_quality.check"),
    Check("markers", "Markers through the whole pipeline", "calibration.check_markers"),
    Check(
        "omnidir", "A calibration library", "calibration.check_omnidir", oracles=("cv2.omnidir",)
    ),
    Check(
        "boards",
        "Calibration files in the hands of others",
        "boards.check",
        oracles=("cv2.omnidir",),
    ),
    Check("orientation", "Orientation", "orientation.check"),
    Check("unwarping", "Unwarped views", "unwarping.check"),
    Check("optics", "Any optics: rays, caustics and pixels", "optics_rays.check"),
    Check(
        "optics-path-tracer",
        "Any optics: real mirrors and windows, traced by another renderer",
        "optics_images.check",
        oracles=("mitsuba",),
        is_quick=False,
    ),
    Check(
        "optics-triangles",
        "Any optics: things a hand's breadth away",
        "optics_triangles.check",
        oracles=("embreex",),
    ),
    Check(
        "optics-calibration",
        "Any optics: calibrations from chessboards",
        "optics_calibration.check",
        oracles=("cv2.omnidir",),
    ),
)


def run_checks(fixture: Fixture, checks: Sequence[Check]) -> Iterator[Section]:
    """Run checks one after the other; a broken oracle fails its check alone.

    Raises:
        OmnisimError: OpenGL is not there, or anything else that a user can put right.
    """
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
                raise  # a defect of ours
            words = " ".join(f"{type(broken).__name__}: {broken}".split())
            section = dataclasses.replace(section, failure=words[:300])
        yield dataclasses.replace(section, seconds=time.perf_counter() - start)


def make_report(sections: Sequence[Section], is_quick: bool, machine: dict[str, Any]) -> Report:
    """Report of the checks that were run; the others are named."""
    run = {section.key for section in sections}
    left_out = [check.title for check in CHECKS if check.key not in run]
    notices = ["Quick report: smaller images and fewer samples."] if is_quick else []
    notices += [f"Left out: {'; '.join(left_out)}."] if left_out else []
    notices += [f"Not checked: {part.title}: {part.skipped}" for part in sections if part.skipped]
    seconds = round(sum(section.seconds or 0.0 for section in sections), 1)
    return Report(
        "Validation",
        "Images against the paper's equations and independent oracles.",
        sections,
        {"quick": is_quick, "left_out": left_out, "seconds": seconds},
        notices,
        machine,
    )
