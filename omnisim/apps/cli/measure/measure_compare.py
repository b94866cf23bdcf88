"""`omnisim measure compare`: a camera's images beside its twin's, as a report."""

from __future__ import annotations

from omnisim.apps.cli.console import out, pluralize, print_note, track
from omnisim.apps.cli.inputs import note_lighting, parse_exposure, refuse_given
from omnisim.apps.cli.measure.comparison_summary import ComparisonSummary, Subject
from omnisim.apps.cli.measure.measured_files import check_size, read_board_shape
from omnisim.apps.cli.measure.requests import MeasureCompareRequest
from omnisim.cameras.calibration.rig import Rig, RigCamera
from omnisim.core.errors import MeasurementError
from omnisim.core.extras import require_extra
from omnisim.core.trajectories.formats.parsed_trajectory import Axes
from omnisim.measurement.comparison import (
    ImageComparison,
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
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.runs.rig_trajectory import RigRoute
from omnisim.scene import read_scene

_BOARD_ONLY = ("mirrored",)
_SCENE_ONLY = ("trajectory", "trajectory_frame", "axes", "exposure_ev")


def compare(request: MeasureCompareRequest) -> bool:
    """Render each image's board or scene by the twin, compare both, and write a report.

    Returns:
        True if all bounds hold on what the sensor file has.

    Raises:
        MeasurementError: images without the board, without a pose, or of another camera.
        SensorFileError: a sensor file with a fault.
        SceneError: a scene that cannot be read.
        TrajectoryError: poses that cannot be read.
        OutputError: the report cannot be written.
    """
    require_extra("measure", "omnisim measure compare", MeasurementError)
    require_extra("reports", "omnisim measure compare", MeasurementError)
    from omnisim.apps.cli.measure.measured_sections import measured_sections
    from omnisim.report.report import Report, check_report_target

    check_report_target(request.output)
    _check_subject(request)
    parts = measured_sections(request.sensor)
    sensor = OmniCamera.from_file(request.sensor)
    if request.board is not None:
        summary = _compare_board(request, request.board, sensor)
    else:
        summary = _compare_scene(request, sensor)
    images = summary.comparison.images
    facts = {"sensor": request.sensor.name, "images": [one.name for one in images]}
    text = f"{pluralize(len(images), 'image')}."
    report = Report("Camera twin", text, (summary.section(), *parts), facts)
    report.write(request.output)
    out.print(f"{request.output}: written", markup=False)
    out.print(summary.text(), markup=False)
    return report.passed


def _check_subject(request: MeasureCompareRequest) -> None:
    """Check that the images show either a board or a scene.

    Raises:
        MeasurementError: neither, both, or options of the other one.
    """
    if (request.board is None) == (request.scene is None):
        actual = "neither" if request.board is None else "both"
        raise MeasurementError(f"--board, --scene: expected one of them, got {actual}")
    if request.board is not None:
        refuse_given(request, "requires --scene", *_SCENE_ONLY, error=MeasurementError)
        return
    refuse_given(request, "requires --board", *_BOARD_ONLY, error=MeasurementError)
    if request.trajectory is None:
        raise MeasurementError("--scene: requires --trajectory, a file with the pose of each image")


def _compare_board(
    request: MeasureCompareRequest, board_text: str, sensor: OmniCamera
) -> ComparisonSummary:
    """Compare all images that have the board."""
    board = read_board(board_text)
    board_m = read_board_shape(request.sensor)
    files = image_files(request.images)
    searches = find_boards(files, board, request.mirrored)
    compared: list[ImageComparison] = []
    notes = []  # printed when all files are read: readers silence the process's standard error
    for number in track(range(len(files)), "Images", len(files)):
        search = next(searches)
        view = search.found
        check_size(files[number], search.size_px, sensor.model, request.sensor)
        if not isinstance(view, BoardView):
            notes.append(f"{view.name} not used: {view.reason}")
            continue
        image = read_gray(files[number])
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
    """Compare all images of a scene."""
    assert request.scene is not None
    assert request.trajectory is not None
    files = image_files(request.images)
    rig = Rig("base", (RigCamera("camera", sensor.model, sensor.base_from_optical),))
    axes: Axes | None = None if request.axes is None else request.axes.value
    route = RigRoute(request.trajectory, request.trajectory_frame, axes)
    notes: list[str] = []  # printed if all images have poses
    poses = route.read_poses(rig, notes.append)
    indices = pose_indices(files, poses.names, len(poses.world_from_body), request.trajectory)
    exposure = parse_exposure(request.exposure_ev)
    if exposure is not None:
        sensor = sensor.with_exposure(exposure)
    scene = read_scene(request.scene)
    for note in (*notes, *scene.notices):
        print_note(note)
    note_lighting(request.scene, scene, "cube", [sensor])
    shutter = sensor.degradation.shutter
    if shutter is not None and shutter.duration_s:
        print_note("the twin is at rest in each image: no motion blur, no rolling shutter")
    photos = zip(files, poses.world_from_body[indices], strict=True)
    twins = compare_scene(sensor, scene, photos)
    compared = [next(twins) for _ in track(range(len(files)), "Images", len(files))]
    comparison = compare_scene_images(sensor, compared)
    brighter = brighter_ev(sensor, compared)
    return ComparisonSummary(comparison, SCENE_SUBJECT, sensor.degradation, brighter)


BOARD_SUBJECT = Subject(
    "Each image's board is rendered in its solved pose by the sensor file, under smooth light "
    "that was fitted to its ink and to its paper. The same detector finds the corners in both.",
    "squares",
    MAX_OFFSET_PX,
)
SCENE_SUBJECT = Subject(
    "The scene is rendered by the sensor file from the pose of each image. Corners of the image "
    "are tracked into the twin's by OpenCV, forward and back, after brightness and contrast are "
    "made equal around each pixel; their bias is a median. Edges are straight, between even "
    "areas; gray levels and noise are those of even blocks of 8 × 8 px. Errors of the scene's "
    "model, its light and the poses are included.",
    "even blocks",
    MAX_TRACKED_PX,
)
