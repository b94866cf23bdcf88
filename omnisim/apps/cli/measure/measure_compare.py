"""`omnisim measure compare`: a camera's images beside its twin's, as a report."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from omnisim.apps.cli.console import out, pluralize, print_note, track
from omnisim.apps.cli.inputs import note_lighting
from omnisim.apps.cli.measure.measured_files import (
    check_size,
    measured_sections,
    read_board_shape,
)
from omnisim.apps.cli.measure.requests import MeasureCompareRequest
from omnisim.apps.cli.options import refuse_given
from omnisim.cameras.calibration.calibration import Rig, RigCamera
from omnisim.core.errors import MeasurementError
from omnisim.core.extras import require_extra
from omnisim.measurement.comparison import (
    Comparison,
    compare_images,
    compare_scene,
    compare_scene_images,
    pose_indices,
)
from omnisim.measurement.comparison.comparison import MAX_OFFSET_PX, compare_image
from omnisim.measurement.comparison.scene_comparison import MAX_OFFSET_PX as MAX_TRACKED_PX
from omnisim.measurement.comparison.scene_comparison import brighter_ev
from omnisim.measurement.geometry import BoardView, find_boards, read_board, read_gray
from omnisim.measurement.geometry.board_detection import image_files
from omnisim.rendering.camera.degradations import Degradation
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.runs.rig_trajectory import RigRoute
from omnisim.scene import read_scene

if TYPE_CHECKING:
    from omnisim.report.report import Measure, Section

_SHOWN = 6  # images in the report
_BIAS_PX, _LEVELS, _RISE_PERCENT, _NOISE = 0.05, 4.0, 15.0, 0.5
_SCENE_ONLY = ("trajectory", "trajectory_frame", "axes", "exposure_ev")


def compare(request: MeasureCompareRequest) -> bool:
    """Render each image's board or scene by the twin, compare both, and write a report.

    Returns True if all bounds hold on what the sensor file has.
    """
    require_extra("measure", "omnisim measure compare", MeasurementError)
    require_extra("reports", "omnisim measure compare", MeasurementError)
    from omnisim.report.report import Report, check_report_target

    check_report_target(request.output)
    if (request.board is None) == (request.scene is None):
        actual = "neither" if request.board is None else "both"
        raise MeasurementError(f"--board, --scene: expected one of them, got {actual}")
    if request.board is not None:
        refuse_given(request, "requires --scene", *_SCENE_ONLY, error=MeasurementError)
    else:
        refuse_given(request, "requires --board", "mirrored", error=MeasurementError)
        if request.trajectory is None:
            expected = "requires --trajectory, a file with the pose of each image"
            raise MeasurementError(f"--scene: {expected}")
    parts = measured_sections(request.sensor)
    sensor = OmniCamera.from_file(request.sensor)
    if request.board is not None:
        summary = _compare_board(request, request.board, sensor)
    else:
        summary = _compare_scene(request, sensor)
    images = summary.comparison.images
    facts = {"sensor": request.sensor.name, "images": [image.name for image in images]}
    text = f"{pluralize(len(images), 'image')}."
    report = Report("Camera twin", text, (summary.section(), *parts), facts)
    report.write(request.output)
    out.print(f"{request.output}: written")
    out.print(summary.text())
    return report.passed


def _compare_board(
    request: MeasureCompareRequest, board_text: str, sensor: OmniCamera
) -> ComparisonSummary:
    board = read_board(board_text)
    board_m = read_board_shape(request.sensor)
    files = image_files(request.images)
    compared = []
    notes = []  # printed when all files are read: readers silence the process's standard error
    searches = find_boards(files, board, request.mirrored)
    for file, search in zip(track(files, "Images"), searches, strict=True):
        view = search.found
        check_size(file, search.size_px, sensor.model, request.sensor)
        if not isinstance(view, BoardView):
            notes.append(f"{view.name} not used: {view.reason}")
            continue
        image = read_gray(file)
        try:
            compared.append(compare_image(sensor, board, view, image, board_m, request.mirrored))
        except MeasurementError as reason:
            notes.append(f"{reason}: not compared")
    for note in notes:
        print_note(note)
    if not compared:
        raise MeasurementError(f"{request.images}: no image could be compared")
    return ComparisonSummary(compare_images(sensor, compared), BOARD_SUBJECT, sensor.degradation)


def _compare_scene(request: MeasureCompareRequest, sensor: OmniCamera) -> ComparisonSummary:
    assert request.scene is not None
    assert request.trajectory is not None
    files = image_files(request.images)
    rig = Rig("base", (RigCamera("camera", sensor.model, sensor.base_from_optical),))
    route = RigRoute(request.trajectory, request.trajectory_frame, request.axes)
    notes: list[str] = []  # printed if all images have poses
    poses = route.read_poses(rig, notes.append)
    indices = pose_indices(files, poses.names, len(poses.world_from_body), request.trajectory)
    if request.exposure_ev is not None:
        sensor = sensor.with_exposure(request.exposure_ev)
    scene = read_scene(request.scene)
    for note in (*notes, *scene.notices):
        print_note(note)
    note_lighting(request.scene, scene, "cube", [sensor])
    shutter = sensor.degradation.shutter
    if shutter is not None and shutter.duration_s:
        print_note("the twin is at rest in each image: no motion blur, no rolling shutter")
    photos = zip(files, poses.world_from_body[indices], strict=True)
    compared = list(track(compare_scene(sensor, scene, photos), "Images", len(files)))
    comparison = compare_scene_images(sensor, compared)
    brighter = brighter_ev(sensor, compared)
    return ComparisonSummary(comparison, SCENE_SUBJECT, sensor.degradation, brighter)


@dataclass(frozen=True)
class Subject:
    """Content of the images."""

    text: str  # description of the comparison
    patches: str  # name of the patches whose gray levels are compared
    max_offset_px: float  # offset beyond which a corner counts as lost


BOARD_SUBJECT = Subject(
    "The sensor file's camera renders each image's board in its solved pose, under smooth light "
    "fitted to its ink and its paper. The same detector finds the corners in both images.",
    "squares",
    MAX_OFFSET_PX,
)
SCENE_SUBJECT = Subject(
    "The sensor file's camera renders the scene from the pose of each image. OpenCV tracks corners "
    "from the image to the twin's and back, after brightness and contrast are equalized around "
    "each pixel; their bias is a median. Edges are straight, between even areas; gray levels and "
    "noise are those of even blocks of 8 × 8 px. Errors of the scene's model, its light and the "
    "poses are included.",
    "even blocks",
    MAX_TRACKED_PX,
)


@dataclass(frozen=True, eq=False)
class ComparisonSummary:
    """Comparison with the words that describe it."""

    comparison: Comparison  # errors of the twin
    subject: Subject  # content of the images
    # effects in the twin's sensor file, of which blur and noise are compared
    degradation: Degradation
    # light of the images over that of the twin's, EV; None: fitted
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
        return max((abs(band.twin_noise - band.noise) for band in noise), default=math.nan)

    @property
    def measures(self) -> tuple[Measure, ...]:
        """Errors with their bounds; those of blur and noise need their part of the sensor file."""
        from omnisim.report.report import Measure

        made, patches = self.degradation, self.subject.patches
        level, rise, noise = self.level_error, self.rise_error, self.noise_error
        no_level = "" if math.isfinite(level) else f"no {patches}"
        no_rise = "" if math.isfinite(rise) else "no edge is long enough"
        if made.point_spread is None and made.defocus is None:
            no_rise = "the sensor file has no blur"
        no_noise = "the sensor file has no noise" if made.noise is None else ""
        measures = [
            Measure("largest bias of corners, by ring", self.comparison.bias_px, "px", _BIAS_PX),
            Measure(f"gray levels of 90 % of the {patches}", level, "of 255", _LEVELS,
                    unmeasured=no_level),
            Measure("10–90 % rise of edges, by ring", 100.0 * rise, "%", _RISE_PERCENT,
                    unmeasured=no_rise),
        ]  # fmt: skip
        if math.isfinite(noise):
            name = "noise, by gray level"
            measures.append(Measure(name, noise, "gray levels", _NOISE, unmeasured=no_noise))
        if self.brighter_ev is not None:
            name = "exposure of the images relative to the twin's, median"
            measures.append(Measure(name, self.brighter_ev, "EV"))
        return tuple(measures)

    def text(self) -> str:
        """Line of the most important numbers, and what they miss or do not check."""
        comparison, patches = self.comparison, self.subject.patches
        level, rise, noise = self.level_error, self.rise_error, self.noise_error
        parts = [
            f"{pluralize(len(comparison.images), 'image')}: corners of the twin with a bias of at "
            f"most {comparison.bias_px:.3f} px in any ring, {comparison.lost} lost"
        ]
        if math.isfinite(level):
            parts.append(f"gray levels within {level:.1f} of 255 for 90 % of the {patches}")
        else:
            parts.append(f"no {patches} to compare gray levels")
        is_long = math.isfinite(rise)
        parts.append(f"edges within {100.0 * rise:.0f} %" if is_long else "no edge long enough")
        if math.isfinite(noise):
            parts.append(f"noise within {noise:.2f} gray levels")
        if (ev := self.brighter_ev) is not None and math.isfinite(ev):
            parts.append(f"images brighter than the twin's by {ev:+z.2f} EV")
        measures = self.measures
        missed = [measure.name for measure in measures if measure.passed is False]
        unmeasured = [f"{each.name} ({each.unmeasured})" for each in measures if each.unmeasured]
        lists = (("missed", missed), ("not measured", unmeasured))
        return "; ".join(
            parts + [f"{title}: {', '.join(names)}" for title, names in lists if names]
        )

    def section(self) -> Section:
        """Section of the report."""
        from omnisim.plots.measured_plots import edge_figure, noise_figure, sheet_figure
        from omnisim.report.report import CaptionedFigure, ResultTable, Section

        comparison = self.comparison
        step = max(1, len(comparison.images) // _SHOWN)
        shown = comparison.images[::step][:_SHOWN]
        caption = "Images of the camera and of the twin, and twin minus camera"
        figures = [
            CaptionedFigure("images", sheet_figure(shown), caption),
            CaptionedFigure("edges", edge_figure(comparison), "Corners and edges over the field"),
        ]
        if comparison.noise:
            caption = "Noise by gray level, with fine texture, in even blocks of images and twin"
            figures.append(CaptionedFigure("noise-levels", noise_figure(comparison), caption))
        columns = (
            "up to px", "corners", "lost", "radial bias", "tangential bias", "RMS",
            "edge rise", "twin's",
        )  # fmt: skip
        rows = []
        for ring in comparison.rings:
            errors = (_number(bias_px, "+.3f") for bias_px in ring.bias_px)
            rises = (_number(rise_px, ".2f") for rise_px in (ring.rise_px, ring.twin_rise_px))
            counts = f"{ring.radius_px:.0f}", str(ring.corners), str(ring.lost)
            rows.append((*counts, *errors, _number(ring.rms_px, ".3f"), *rises))
        limit = self.subject.max_offset_px
        caption = f"Rings of the image, px. Lost: more than {limit:g} px off, or not detected."
        table = ResultTable(caption, columns, tuple(rows))
        title = "The camera and its twin"
        return Section(title, self.subject.text, self.measures, (table,), tuple(figures))


def _number(value: float, form: str) -> str:
    return format(value, form) if math.isfinite(value) else "–"
