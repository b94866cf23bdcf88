"""`omnisim render --trajectory`: a camera or a rig along poses, recorded as a run."""

from __future__ import annotations

from pathlib import Path

from omnisim.apps.cli.cameras.calibration import read_calibration
from omnisim.apps.cli.console import pluralize, print_note
from omnisim.apps.cli.images.recording import drive_of, record
from omnisim.apps.cli.images.requests import RenderRequest, RigCameraOptions
from omnisim.apps.cli.inputs import check_calibration_path, read_camera, refuse_given
from omnisim.cameras import NonCentralCamera
from omnisim.cameras.calibration.rig import Rig, RigCamera
from omnisim.core.errors import OutputError, RunError
from omnisim.core.files.image_files import EIGHT_BIT_SUFFIXES, FLOAT_SUFFIXES
from omnisim.core.files.sources import recorded_sources, source_digest
from omnisim.core.poses import pose
from omnisim.core.short_repr import point_text
from omnisim.core.trajectories import Trajectory
from omnisim.core.trajectories.formats.parsed_trajectory import Axes
from omnisim.robots.rig_vehicle import rig_vehicle
from omnisim.robots.vehicle import Vehicle
from omnisim.runs.rig_trajectory import RigRoute
from omnisim.runs.route import Route, route_digest
from omnisim.scene import Scene

ALL = "all"
# Options of a single image, by group; an empty tuple stands for all options of the group.
SINGLE_IMAGE: dict[str, tuple[str, ...]] = {
    "viewpoint": ("at_camera", "time_s"),
    "files": (),
    "flow": (),
    "motion": ("speed_mps", "turn_rate_degps"),
}


def run(request: RenderRequest, path: Path) -> None:
    """Record a run of a rig, or resume an unfinished one, and print a summary.

    Args:
        request: request of `omnisim render`.
        path: trajectory file.
    """
    for group, names in SINGLE_IMAGE.items():
        reason = "expected a single viewpoint, got --trajectory"
        refuse_given(getattr(request, group), reason, *names)
    if request.output.suffix.lower() in EIGHT_BIT_SUFFIXES + FLOAT_SUFFIXES:
        raise OutputError(f"{request.output}: expected a folder with --trajectory, got an image")
    with recorded_sources() as sources:
        rig, vehicle = _rig(request.camera, path)
    if vehicle.given is None:
        own = request.camera.camera_name, request.camera.mirrored
        vehicle = vehicle.identified(source_digest(sources.digest(path.parent), own))
    at, yaw_deg = request.viewpoint.at, request.viewpoint.yaw_deg
    roll_deg, pitch_deg = request.viewpoint.roll_deg, request.viewpoint.pitch_deg
    world_from_file = pose(
        at or (0.0, 0.0, 0.0), roll_deg=roll_deg, pitch_deg=pitch_deg, yaw_deg=yaw_deg or 0.0
    )
    axes: Axes | None = None if request.poses.axes is None else request.poses.axes.value
    route = RigRoute(
        path, request.poses.trajectory_frame, axes, request.poses.rate_hz, world_from_file
    )
    truth, is_timed = route.read(rig, print_note)
    drive = drive_of(request, vehicle, Route(str(path)))
    if not is_timed:
        _refuse_time(drive.vehicle, path)
    _note_poses_outside(drive.scene, truth, path)
    placing = (
        request.viewpoint.at,
        request.viewpoint.roll_deg,
        request.viewpoint.pitch_deg,
        request.viewpoint.yaw_deg,
    )
    options = placing, request.poses.trajectory_frame, axes, request.poses.rate_hz
    plan = drive.along(truth, source_digest(route_digest(drive.route), options)[:16])
    for note in plan.notes:
        print_note(note)
    record(plan, request.output, request.force)


def _rig(camera: RigCameraOptions, path: Path) -> tuple[Rig, Vehicle]:
    """Rig with all cameras named by the poses, and vehicle of the selected cameras."""
    if camera.robot is not None:
        return _robot(camera, camera.robot)
    source = camera.calibration_file
    own_camera = camera.sensor or camera.optics
    if source is None and own_camera is None and path.suffix.lower() == ".json":
        source = path
    if source is None or camera.optics is not None:
        sensor = read_camera(camera, source)
        rig = Rig("base", (RigCamera("camera", sensor.model, sensor.base_from_optical),))
        return rig, rig_vehicle(_name(own_camera), rig, (sensor,))
    check_calibration_path(source, camera.sensor)
    calibration = read_calibration(source, None, None, camera.mirrored)
    name = None if camera.camera_name == ALL else camera.camera_name
    rig = Rig.of(calibration, name)
    return rig, rig_vehicle(_name(source), rig if name is None else rig.only(name))


def _robot(camera: RigCameraOptions, robot: str) -> tuple[Rig, Vehicle]:
    """Rig of a robot's central cameras on its base, and the robot with all of its sensors.

    Raises:
        OutputError: another camera is given as well.
    """
    reason = "expected the robot's sensors with --trajectory and --robot"
    refuse_given(camera, reason, "sensor", "calibration_file", "camera_name", "optics", "mirrored")
    vehicle = Vehicle.load(robot)
    cameras = (
        RigCamera(camera.name, camera.sensor.model, camera.sensor.base_from_optical)
        for camera in vehicle.cameras
        if not isinstance(camera.sensor.model, NonCentralCamera)
    )
    return Rig("base", tuple(cameras)), vehicle


def _name(source: Path | None) -> str:
    return "camera" if source is None else source.stem


def _note_poses_outside(scene: Scene, truth: Trajectory, path: Path) -> None:
    """Print a note on poses outside the scene, which often mean a misplaced origin."""
    low, high = scene.bounds_m()
    outside = ((truth.positions_m < low) | (truth.positions_m > high)).any(axis=1)
    if outside.any():
        corners = (point_text(corner, 4) for corner in (low, high))
        print_note(
            f"{path}: {int(outside.sum())} of {pluralize(len(truth), 'pose')} outside of the "
            f"scene, which spans {' to '.join(corners)} m: --at, --yaw, --pitch and --roll place "
            "the file's origin"
        )


def _refuse_time(vehicle: Vehicle, path: Path) -> None:
    """Raise an error for cameras whose images depend on the time between them.

    Raises:
        RunError: names the camera.
    """
    for camera in vehicle.cameras:
        degradation = camera.sensor.degradation
        shutter = degradation.shutter
        if (shutter is not None and shutter.duration_s) or degradation.is_metered:
            raise RunError(
                f"{path}: has no times, and the exposure of {camera.name} depends on them: "
                "pass --rate HZ"
            )
