"""Detection of landmarks: stacked regions of their colors, at a consistent range.

A slim landmark (a pillar, such as a beacon) is identified by the order of its colors from top to
bottom. Its range follows from the edges of its bands, at known heights, and not from its base,
which is white on light ground and often hidden. A wide landmark, such as a goal, has a single color
from the ground up; its range is that of its nearest corner on the ground, or of its nearest corner
at the top if the ground in front of it is not visible.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from omnisim.core.errors import LocalizationError
from omnisim.core.files.atomic_file import write_text
from omnisim.core.poses import wrap_angle
from omnisim.perception.landmarks.color_model import ColorModel
from omnisim.perception.landmarks.landmark_measurement import (
    LandmarkMeasurement,
    measure_pillar,
    measure_wide,
)
from omnisim.perception.regions import Region, find_regions, wrapped_around
from omnisim.perception.unwarping.panorama import CameraMount, Panorama
from omnisim.scene.model import Landmark

Key = TypeVar("Key")
MIN_PX = 4  # minimum area of a region


@dataclass(frozen=True)
class Detection:
    """Landmark detected in an image.

    Attributes:
        landmark: name of the landmark.
        bearing_rad: bearing of a pillar's axis, or of the middle between the outermost corners of a
            wide landmark, counter-clockwise from the vehicle's front.
        range_m: distance along the ground from below the effective viewpoint to a pillar's axis, or
            to the nearest corner of a wide landmark, by the exact relation.
        range_eq2_m: the same range by the inverse of the paper's Eq. 2; NaN: it does not apply.
        bearing_sigma_rad, range_sigma_m: standard deviations from the noise of the pixels.
        left, right, top, bottom: box in the panorama, px; `right` and `bottom` are the first column
            and row outside.
        area_px: number of pixels with the landmark's colors.
    """

    landmark: str
    bearing_rad: float
    range_m: float
    range_eq2_m: float
    bearing_sigma_rad: float
    range_sigma_m: float
    left: int
    right: int
    top: int
    bottom: int
    area_px: int


class LandmarkDetector:
    """Detector of a scene's landmarks in one camera's images.

    Args:
        model: color model of the landmarks.
        landmarks: landmarks of the scene; landmarks with colors that the model lacks are ignored.
        mount: camera on the vehicle.

    Attributes:
        panorama: panorama for the detection.
        ignored: names of the ignored landmarks.

    Raises:
        LocalizationError: no landmark to detect, or two with the same colors.
    """

    def __init__(self, model: ColorModel, landmarks: Sequence[Landmark], mount: CameraMount):
        self.model = model
        self.panorama = Panorama(mount)
        self._pillars: dict[tuple[int, int], Landmark] = {}
        self._wide: dict[int, Landmark] = {}
        for landmark in landmarks:
            classes = [model.color_class(band.color) for band in landmark.bands]
            shown = [color for color in classes if color]
            if not landmark.is_slim and len(shown) == 1:
                _add(self._wide, shown[0], landmark)
            elif landmark.is_slim and len(shown) == 2 and all(classes[-2:]):
                _add(self._pillars, (shown[0], shown[1]), landmark)
        known = {each.name for each in (*self._pillars.values(), *self._wide.values())}
        self.ignored = tuple(each.name for each in landmarks if each.name not in known)
        if not self._pillars and not self._wide:
            raise LocalizationError(
                "landmarks: none has colors of the model: expected pillars whose upper bands, "
                f"or wide ones whose only band, are of {', '.join(model.colors)}"
            )

    def classes(self, panorama: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """Classify the pixels (height, width) of a panorama."""
        return self.model.classify(panorama)

    def __call__(self, image: NDArray[np.uint8]) -> list[Detection]:
        """Detect landmarks in an image (height, width, 3), sRGB; each at most once."""
        return self.find(self.panorama(image))

    def find(self, panorama: NDArray[np.uint8]) -> list[Detection]:
        """Detect landmarks in a panorama (height, width, 3), sRGB, made by `self.panorama`."""
        classes = self.classes(panorama)
        regions = find_regions(classes, len(self.model.colors), MIN_PX)
        doubled = wrapped_around(panorama)
        measured: list[tuple[Landmark, LandmarkMeasurement]] = []
        in_pillars: set[int] = set()
        for lower, upper in _stacked(regions):
            landmark = self._pillars.get((lower.color, upper.color))
            if landmark is None:
                continue
            finding = measure_pillar(self.panorama, doubled, lower, upper, landmark)
            if finding is not None:
                measured.append((landmark, finding))
                in_pillars |= {id(lower), id(upper)}
        for region in regions:
            landmark = self._wide.get(region.color)
            if landmark is None or id(region) in in_pillars:
                continue
            finding = measure_wide(self.panorama, doubled, region, landmark)
            if finding is not None:
                measured.append((landmark, finding))
        return [self._detection(landmark, best) for landmark, best in _best_of_each(measured)]

    def _detection(self, landmark: Landmark, finding: LandmarkMeasurement) -> Detection:
        width = self.panorama.camera.width_px
        turns = finding.left // width  # boxes start within the panorama
        bearing = float(self.panorama.bearings_rad(finding.column))
        return Detection(
            landmark.name,
            wrap_angle(bearing),
            finding.range_m,
            finding.range_eq2_m,
            finding.column_sigma_px / self.panorama.camera.focal_length_px,
            finding.range_sigma_m,
            finding.left - turns * width,
            finding.right - turns * width,
            finding.top,
            finding.bottom,
            finding.area_px,
        )


def _add(known: dict[Key, Landmark], key: Key, landmark: Landmark) -> None:
    if key in known:
        raise LocalizationError(
            f"landmarks {known[key].name!r} and {landmark.name!r}: look the same: expected other "
            "colors, or another order of them"
        )
    known[key] = landmark


def _stacked(regions: Sequence[Region]) -> list[tuple[Region, Region]]:
    """Pairs of regions of two colors, the second directly above the first."""
    pairs = []
    for lower in regions:
        for upper in regions:
            if lower.color == upper.color or upper.top >= lower.top:
                continue
            height = max(lower.mask.shape[0], upper.mask.shape[0])
            # blurred edges have neither color: a gap, or a ragged overlap
            slack = 2 + 0.35 * height
            overlap = min(lower.right, upper.right) - max(lower.left, upper.left)
            narrow = min(lower.mask.shape[1], upper.mask.shape[1])
            if abs(lower.top - upper.bottom) <= slack and overlap >= 0.5 * narrow:
                pairs.append((lower, upper))
    return pairs


def _best_of_each(
    measured: list[tuple[Landmark, LandmarkMeasurement]],
) -> list[tuple[Landmark, LandmarkMeasurement]]:
    """Keep the measurement with the most pixels of each landmark, which exists only once."""
    best: dict[str, tuple[Landmark, LandmarkMeasurement]] = {}
    for landmark, finding in measured:
        other = best.get(landmark.name)
        if other is None or finding.area_px > other[1].area_px:
            best[landmark.name] = (landmark, finding)
    return list(best.values())


# Detections as CSV: one per line, `step` first; angles in degrees.


COLUMNS = (
    "step,landmark,bearing_deg,range_m,range_eq2_m,bearing_sigma_deg,range_sigma_m,"
    "left_px,right_px,top_px,bottom_px,area_px"
)
DETECTIONS_SUFFIX = ".csv"


def write_detections(path: Path, detections: Iterable[tuple[int, Detection]]) -> None:
    """Write detections with their steps; atomically.

    Raises:
        OutputError: the file cannot be written.
    """
    lines = [COLUMNS]
    for step, detection in detections:
        numbers = (
            math.degrees(detection.bearing_rad),
            detection.range_m,
            detection.range_eq2_m,
            math.degrees(detection.bearing_sigma_rad),
            detection.range_sigma_m,
        )
        box = (detection.left, detection.right, detection.top, detection.bottom, detection.area_px)
        cells = (*(f"{number:.6f}" for number in numbers), *map(str, box))
        lines.append(",".join((str(step), detection.landmark, *cells)))
    write_text(path, "\n".join(lines) + "\n")
