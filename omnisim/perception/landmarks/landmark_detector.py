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
from scipy import ndimage

from omnisim.core.arrays import Bools, Bytes, Floats, Indices
from omnisim.core.errors import LocalizationError
from omnisim.core.files.atomic_file import write_text
from omnisim.core.poses import wrap_angle
from omnisim.core.srgb import LINEAR_FROM_SRGB8
from omnisim.perception.landmarks.color_model import ColorModel
from omnisim.perception.unwarping import CameraMount, Panorama
from omnisim.scene.model import Landmark

Key = TypeVar("Key")
MIN_PX = 4  # minimum area of a region


@dataclass(frozen=True)
class Detection:
    """Landmark detected in an image.

    The range is along the ground from below the effective viewpoint to a pillar's axis, or to the
    nearest corner of a wide landmark; the bearing is of the axis, or of the middle between the
    outermost corners, counter-clockwise from the vehicle's front. Sigmas are from the pixels'
    noise.
    """

    landmark: str  # its name
    bearing_rad: float
    range_m: float  # by the exact relation
    range_eq2_m: float  # by the inverse of the paper's Eq. 2; NaN: it does not apply
    bearing_sigma_rad: float
    range_sigma_m: float
    left: int  # box in the panorama, px
    right: int  # first column outside
    top: int
    bottom: int  # first row outside
    area_px: int  # number of pixels with the landmark's colors


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
                "landmarks: none can be detected by the model's colors: expected pillars whose "
                "two upper bands, or wide landmarks whose only band, have the colors "
                f"{', '.join(model.colors)}"
            )

    def classes(self, panorama: Bytes) -> Bytes:
        """Classify the pixels (height, width) of a panorama."""
        return self.model.classify(panorama)

    def __call__(self, image: Bytes) -> list[Detection]:
        """Detect landmarks in an image (height, width, 3), sRGB; each at most once."""
        return self.find(self.panorama(image))

    def find(self, panorama: Bytes) -> list[Detection]:
        """Detect landmarks in a panorama (height, width, 3), sRGB, made by `self.panorama`."""
        classes = self.classes(panorama)
        regions = find_regions(classes, len(self.model.colors), MIN_PX)
        doubled = wrapped_around(panorama)
        found: list[Detection] = []
        in_pillars: set[int] = set()
        for lower, upper in _stacked(regions):
            landmark = self._pillars.get((lower.color, upper.color))
            if landmark is None:
                continue
            detection = _measure_pillar(self.panorama, doubled, lower, upper, landmark)
            if detection is not None:
                found.append(detection)
                in_pillars |= {id(lower), id(upper)}
        for region in regions:
            landmark = self._wide.get(region.color)
            if landmark is not None and id(region) not in in_pillars:
                detection = _measure_wide(self.panorama, doubled, region, landmark)
                found += [] if detection is None else [detection]
        largest: dict[str, Detection] = {}
        for detection in found:  # a landmark exists only once
            other = largest.get(detection.landmark)
            if other is None or detection.area_px > other.area_px:
                largest[detection.landmark] = detection
        return list(largest.values())


def _add(known: dict[Key, Landmark], key: Key, landmark: Landmark) -> None:
    if key in known:
        raise LocalizationError(
            f"landmarks {known[key].name!r} and {landmark.name!r}: look the same: expected other "
            "colors, or another order of them"
        )
    known[key] = landmark


def _stacked(regions: Sequence[LandmarkRegion]) -> list[tuple[LandmarkRegion, LandmarkRegion]]:
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


# Range and bearing of landmarks from the edges of their colors in a panorama.
#
# An edge is located to a fraction of a pixel from the mixture of the two colors in the pixels
# across it, in linear light, in which they mix by area.


# Noise of an edge in pixels, measured on drives: see the page on the experiments.
EDGE_SIGMA_PX = 0.2
WIDE_EDGE_SIGMA_PX = 0.8  # for corners too slim to be visible alone
CORNER_SIGMA_M = 0.01  # position of the corner on the ends of its boards
MASK_SIGMA_PX = 0.8  # for edges of masks, known to whole pixels
# More than the average error of 0.17 px: light that falls off around a beacon shifts the middle of
# its mask by 0.4 px, equally in successive images.
COLUMN_SIGMA_PX = 0.3
MAX_SIGMAS = 4.0  # maximum disagreement of the edges of one landmark
MAX_M = 30.0  # maximum range: beyond, landmarks of these sizes are below a pixel


def _measure_pillar(
    panorama: Panorama,
    pixels: Bytes,
    lower: LandmarkRegion,
    upper: LandmarkRegion,
    landmark: Landmark,
) -> Detection | None:
    """Measure a pillar from regions of its two upper bands; None: it has another size.

    `pixels` are the panorama's, sRGB, with its left half repeated on the right.
    """
    left, right = min(lower.left, upper.left), max(lower.right, upper.right)
    counts = np.zeros(right - left)
    for region in (lower, upper):
        start = region.left - left
        counts[start : start + region.mask.shape[1]] += region.mask.sum(axis=0)
    column = left + float(counts @ np.arange(len(counts))) / float(counts.sum())
    # at the lowest point of the bands' lower edges, which bend around the pillar
    half = max(0.5, 0.2 * float(np.count_nonzero(counts)))
    first = max(left, round(column - half))
    core = slice(first, max(first + 1, min(right, round(column + half) + 1)))
    rows = slice(max(upper.top - 3, 0), min(lower.bottom + lower.mask.shape[0] + 3, len(pixels)))
    profile = LINEAR_FROM_SRGB8[pixels[rows, core]].mean(axis=1)
    middle = _edge_between(profile, _inner(upper, rows.start), _inner(lower, rows.start))
    below = slice(
        lower.bottom - rows.start + 2,
        max(lower.bottom + lower.mask.shape[0] // 2, lower.bottom + 3) - rows.start,
    )
    foot = _edge_between(profile, _inner(lower, rows.start), below)
    radius_m = 0.25 * sum(landmark.footprint_m)
    low, high = landmark.bands[-2], landmark.bands[-1]
    # for each edge: height, row, noise, and distance in front of the axis
    edges = [
        (high.top_m, upper.top - 0.5, MASK_SIGMA_PX, -radius_m),  # the far rim of its flat top
        (high.bottom_m, middle + rows.start, EDGE_SIGMA_PX, radius_m),
        (low.bottom_m, foot + rows.start, EDGE_SIGMA_PX, radius_m),
    ]
    edges = [edge for edge in edges if math.isfinite(edge[1])]
    fitted = _fit_range(panorama, edges)
    if fitted is None:
        return None
    width_px = 2.0 * radius_m / fitted[0] * panorama.camera.focal_length_px
    if not 0.4 * width_px - 1.5 <= right - left <= 1.8 * width_px + 2.5:
        return None
    box = left, right, upper.top, lower.bottom
    return _detection(panorama, landmark, column, fitted, box, lower.area_px + upper.area_px)


def _inner(region: LandmarkRegion, first: int) -> slice:
    """Rows in the middle of a region, with a pure color; counted from row `first`."""
    height = region.mask.shape[0]
    edge = (height - 1) // 3 if height > 2 else 0
    return slice(region.top + edge - first, region.bottom - edge - first)


def _edge_between(profile: Floats, above: slice, below: slice) -> float:
    """Row, with a fraction, at which a profile (n, 3), linear, changes from one color to another.

    The rows `above` have the first color, the rows `below` the second. NaN if the colors are alike,
    or one of them has no rows.
    """
    first, last = (above.start + above.stop - 1) // 2, (below.start + below.stop) // 2
    upper, lower = profile[above], profile[below]
    if not len(upper) or not len(lower) or last <= first:
        return math.nan
    start, end = upper.mean(axis=0), lower.mean(axis=0)
    change = end - start
    contrast = float(change @ change)
    if contrast < 1e-3:
        return math.nan
    share = np.clip((end - profile[first : last + 1]) @ change / contrast, 0.0, 1.0)
    return float(first - 0.5 + float(share.sum()))


def _fit_range(
    panorama: Panorama, edges: list[tuple[float, float, float, float]]
) -> tuple[float, float, float] | None:
    """Range by the exact relation, range by Eq. 2, and standard deviation, in m, of edges.

    An edge has a height in m, a row, its standard deviation in px, and a distance in m in front of
    the pillar's axis. The edge with the largest residual is dropped while edges disagree, since it
    may be hidden. None: fewer than two edges agree, or an edge is out of range.
    """
    while len(edges) >= 2:
        ranges, paper, sigmas = [], [], []
        for height_m, row, sigma_px, ahead_m in edges:
            range_m = float(panorama.ranges_m(row, height_m))
            if not 0.0 < range_m + ahead_m < MAX_M:
                return None
            ranges.append(range_m + ahead_m)
            paper.append(float(panorama.ranges_eq2_m(row, height_m)) + ahead_m)
            sigmas.append(float(panorama.range_sigmas_m(range_m, height_m, sigma_px)))
        weights = np.square(1.0 / np.array(sigmas))
        weights /= weights.sum()
        mean = float(weights @ ranges)
        misfits = np.abs(np.array(ranges) - mean) / sigmas
        # 2 %: error of the model itself, such as polygons for circles or a mesh for a mirror
        allowed = MAX_SIGMAS + 0.02 * mean / min(sigmas)
        if misfits.max() <= allowed:
            sigma = float(math.sqrt(np.sum(np.square(weights * sigmas))))
            return mean, float(weights @ paper), sigma
        edges = [edge for k, edge in enumerate(edges) if k != int(misfits.argmax())]
    return None


def _measure_wide(
    panorama: Panorama, pixels: Bytes, region: LandmarkRegion, landmark: Landmark
) -> Detection | None:
    """Measure a wide landmark of one color on the ground; None: the region cannot be the landmark.

    `pixels` are the panorama's, sRGB, with its left half repeated on the right.
    """
    height, width = region.mask.shape
    if height < 3 or width < 4:
        return None
    columns = np.arange(width)
    top = region.top + region.mask.argmax(axis=0)
    bottom = region.bottom - 1 - region.mask[::-1].argmax(axis=0)
    is_cut = region.bottom >= len(pixels) - 1
    top_m = landmark.bands[-1].top_m
    if is_cut:  # the ground in front of it is below the image
        rows, height_m, sigma_px = top - 0.5, top_m, MASK_SIGMA_PX
    else:
        rows = _lower_edges(pixels, bottom, region.left + columns)
        height_m, sigma_px = 0.0, WIDE_EDGE_SIGMA_PX
    ranges = panorama.ranges_m(rows, height_m)
    # the nearest corner is one or two columns wide: a mean with its neighbors would miss it
    nearest = int(ranges.argmin())
    range_m = float(ranges[nearest])
    if not 0.0 < range_m < MAX_M:
        return None
    longest, shortest = math.hypot(*landmark.footprint_m), min(landmark.footprint_m)
    # the visible top is that of the nearest corner, or of the far end behind it
    drop_m = panorama.mount.height_m - top_m
    limits = (top_m, panorama.mount.height_m - drop_m * range_m / (range_m + longest))
    slack_m = 0.15 * top_m + 2.0 * range_m / panorama.camera.focal_length_px
    # median of three columns, because the mask of a post may begin far below its top
    first = min(max(nearest - 1, 0), width - 3)
    at = slice(first, first + 3)
    seen_m = float(np.median(panorama.heights_m(top[at] - 0.5, range_m)))
    if not is_cut and not min(limits) - slack_m <= seen_m <= max(limits) + slack_m:
        return None
    spread_m = width / panorama.camera.focal_length_px * range_m
    if not 0.7 * shortest <= spread_m <= 1.5 * longest:
        return None
    sigma_m = float(panorama.range_sigmas_m(range_m, height_m, sigma_px))
    sigma_m = math.hypot(sigma_m, CORNER_SIGMA_M)
    if is_cut:  # the top that is seen may be that of its far end
        sigma_m += longest
    range_eq2_m = float(panorama.ranges_eq2_m(panorama.rows(range_m, height_m), height_m))
    box = region.left, region.right, region.top, region.bottom
    column = region.left + 0.5 * (width - 1)
    ranges_m = range_m, range_eq2_m, sigma_m
    return _detection(panorama, landmark, column, ranges_m, box, region.area_px)


def _detection(
    panorama: Panorama,
    landmark: Landmark,
    column: float,
    ranges_m: tuple[float, float, float],
    box: tuple[int, int, int, int],
    area_px: int,
) -> Detection:
    """Detection at a column, which may exceed the panorama's right edge, as may the box's.

    Ranges are by the exact relation and by Eq. 2, and the standard deviation. The box is left,
    right, top and bottom.
    """
    camera = panorama.camera
    range_m, range_eq2_m, sigma_m = ranges_m
    left, right, top, bottom = box
    start = left // camera.width_px * camera.width_px  # boxes start within the panorama
    return Detection(
        landmark.name, wrap_angle(float(panorama.bearings_rad(column))), range_m, range_eq2_m,
        COLUMN_SIGMA_PX / camera.focal_length_px, sigma_m,
        left - start, right - start, top, bottom, area_px,
    )  # fmt: skip


def _lower_edges(pixels: Bytes, bottom: Indices, columns: Indices) -> Floats:
    """Rows (n,), with fractions, of a region's lower edge in columns (n,) of the panorama.

    `bottom` (n,) is the lowest whole row of the region in each column.
    """
    steps = np.arange(-2, 3)  # no farther: the next thing, a line, may be narrow
    rows = np.clip(bottom[:, None] + steps, 0, len(pixels) - 1)
    profile = LINEAR_FROM_SRGB8[pixels[rows, columns[:, None] % pixels.shape[1]]]
    inside, outside = profile[:, :1], profile[:, -1:]
    change = inside - outside
    contrast = np.maximum((change * change).sum(axis=-1), 1e-3)
    share = np.clip(((profile - outside) * change).sum(axis=-1) / contrast, 0.0, 1.0)
    return bottom - 2.5 + share.sum(axis=1)


# Connected regions of one color in a panorama, which continues from its right to its left edge.


Scalar = TypeVar("Scalar", bound=np.generic)
_EIGHT = np.ones((3, 3), dtype=np.int8)


@dataclass(frozen=True, eq=False)
class LandmarkRegion:
    """Pixels of one class (`color`) that are connected by edges or corners."""

    color: int
    # top, left: position of the mask in the panorama; columns may exceed its right edge
    top: int
    left: int
    mask: Bools  # (height, width) mask of the region's pixels in its bounding box

    @property
    def bottom(self) -> int:
        """First row below the region."""
        return self.top + int(self.mask.shape[0])

    @property
    def right(self) -> int:
        """First column to the right of the region."""
        return self.left + int(self.mask.shape[1])

    @property
    def area_px(self) -> int:
        """Number of pixels."""
        return int(np.count_nonzero(self.mask))


def wrapped_around(panorama: NDArray[Scalar]) -> NDArray[Scalar]:
    """Panorama (height, width, ...) with a copy of its left half appended on the right."""
    return np.concatenate((panorama, panorama[:, : panorama.shape[1] // 2]), axis=1)


def find_regions(classes: Bytes, colors: int, min_area_px: int) -> list[LandmarkRegion]:
    """Regions of a panorama's classes (0: none) of at least `min_area_px` pixels, each once.

    A region may cross the panorama's left and right edge.
    """
    width = classes.shape[1]
    colored = np.flatnonzero(classes.any(axis=1))
    if not len(colored):
        return []
    above = int(colored[0])  # rows without color above and below are skipped
    doubled = wrapped_around(classes[above : int(colored[-1]) + 1])
    # the middle of each region is within one turn that starts a quarter from the left
    first = width // 4
    regions = []
    for color in range(1, colors + 1):
        labels, count = ndimage.label(doubled == color, structure=_EIGHT)
        areas = np.bincount(labels.ravel(), minlength=count + 1)
        for index, slices in enumerate(ndimage.find_objects(labels), start=1):
            if areas[index] < min_area_px:
                continue
            rows, columns = slices
            if not first <= (columns.start + columns.stop) // 2 < first + width:
                continue
            mask = labels[slices] == index
            regions.append(LandmarkRegion(color, above + rows.start, columns.start, mask))
    return regions


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
            math.degrees(detection.bearing_rad), detection.range_m, detection.range_eq2_m,
            math.degrees(detection.bearing_sigma_rad), detection.range_sigma_m,
        )  # fmt: skip
        box = (detection.left, detection.right, detection.top, detection.bottom, detection.area_px)
        cells = (*(f"{number:.6f}" for number in numbers), *map(str, box))
        lines.append(",".join((str(step), detection.landmark, *cells)))
    write_text(path, "\n".join(lines) + "\n")
