"""`omnisim render --trajectory`: a camera or a rig along poses, recorded as a run."""

from __future__ import annotations

from pathlib import Path

from omnisim.apps.cli.cameras.calibration import read_calibration
from omnisim.apps.cli.console import pluralize, print_note
from omnisim.apps.cli.images.image_requests import RenderRequest
from omnisim.apps.cli.images.recording import drive_of, record
from omnisim.apps.cli.inputs import check_calibration_path, read_camera, refuse_options
from omnisim.cameras import NonCentralCamera
from omnisim.cameras.calibration.rig import Rig, RigCamera
from omnisim.core.errors import OutputError, RunError
from omnisim.core.files.image_files import EIGHT_BIT_SUFFIXES, FLOAT_SUFFIXES
from omnisim.core.files.sources import recorded_sources, source_digest
from omnisim.core.poses import pose
from omnisim.core.trajectories import Trajectory
from omnisim.core.trajectories.formats.parsed_trajectory import Axes
from omnisim.robots.rig_vehicle import rig_vehicle
from omnisim.robots.vehicle import Vehicle
from omnisim.runs.rig_trajectory import RigRoute
from omnisim.runs.route import Route, route_digest
from omnisim.scene import Scene

ALL = "all"
OWN_CAMERA = {
    "--sensor": "sensor",
    "--camera": "camera",
    "--camera-name": "camera_name",
    "--optics": "optics",
    "--mirrored": "mirrored",
}
SINGLE_IMAGE = {
    "--at-camera": "at_camera",
    "--faces": "faces",
    "--next": "next_at",
    "--next-yaw": "next_yaw_deg",
    "--previous": "previous_at",
    "--previous-yaw": "previous_yaw_deg",
    "--time": "time_s",
    "--interval": "interval_s",
    "--preview": "preview",
    "--speed": "speed_mps",
    "--turn-rate": "turn_rate_degps",
    "--rays": "rays",
    "--calibration": "calibration",
}


def run(request: RenderRequest, path: Path) -> None:
    """Record a run of a rig, or resume an unfinished one, and print a summary.

    Args:
        request: of `omnisim render`.
        path: of the trajectory.
    """
    refuse_options(request, SINGLE_IMAGE, "expected a single viewpoint, got --trajectory")
    if request.output.suffix.lower() in EIGHT_BIT_SUFFIXES + FLOAT_SUFFIXES:
        raise OutputError(f"{request.output}: expected a folder with --trajectory, got an image")
    with recorded_sources() as sources:
        rig, vehicle = _rig(request, path)
    if vehicle.given is None:
        own = request.camera_name, request.mirrored
        vehicle = vehicle.identified(source_digest(sources.digest(path.parent), own))
    world_from_file = pose(
        request.at or (0.0, 0.0, 0.0), request.roll_deg, request.pitch_deg, request.yaw_deg or 0.0
    )
    axes: Axes | None = None if request.axes is None else request.axes.value
    route = RigRoute(path, request.trajectory_frame, axes, request.rate_hz, world_from_file)
    truth, is_timed = route.read(rig, print_note)
    drive = drive_of(request, vehicle, Route(str(path)))
    if not is_timed:
        _refuse_time(drive.vehicle, path)
    _note_poses_outside(drive.scene, truth, path)
    placing = request.at, request.roll_deg, request.pitch_deg, request.yaw_deg
    options = placing, request.trajectory_frame, axes, request.rate_hz
    plan = drive.along(truth, source_digest(route_digest(drive.route), options)[:16])
    for note in plan.notes:
        print_note(note)
    record(plan, request.output, request.force)


def _rig(request: RenderRequest, path: Path) -> tuple[Rig, Vehicle]:
    """Rig of the whole file, whose frames the poses may be of, and vehicle of the cameras taken."""
    if request.robot is not None:
        return _robot(request, request.robot)
    source = request.camera
    own_camera = request.sensor or request.optics
    if source is None and own_camera is None and path.suffix.lower() == ".json":
        source = path
    if source is None or request.optics is not None:
        sensor = read_camera(
            request.sensor, source, request.camera_name, request.mirrored, request.optics
        )
        rig = Rig("base", (RigCamera("camera", sensor.model, sensor.base_from_optical),))
        return rig, rig_vehicle(_name(own_camera), rig, (sensor,))
    check_calibration_path(source, request.sensor)
    calibration = read_calibration(source, None, None, request.mirrored)
    name = None if request.camera_name == ALL else request.camera_name
    rig = Rig.of(calibration, name)
    return rig, rig_vehicle(_name(source), rig if name is None else rig.only(name))


def _robot(request: RenderRequest, robot: str) -> tuple[Rig, Vehicle]:
    """Cameras of a robot on its base, and the robot with all of its sensors.

    Raises:
        OutputError: another camera beside the robot's.
    """
    reason = "expected the robot's sensors with --trajectory and --robot"
    refuse_options(request, OWN_CAMERA, reason)
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
    """Print a note on poses outside of the scene: an origin that is not placed is seldom meant."""
    low, high = scene.bounds_m()
    outside = ((truth.positions_m < low) | (truth.positions_m > high)).any(axis=1)
    if outside.any():
        corners = (f"({', '.join(f'{value:.4g}' for value in corner)})" for corner in (low, high))
        print_note(
            f"{path}: {int(outside.sum())} of {pluralize(len(truth), 'pose')} outside of the "
            f"scene, which spans {' to '.join(corners)} m: --at, --yaw, --pitch and --roll place "
            "the file's origin"
        )


def _refuse_time(vehicle: Vehicle, path: Path) -> None:
    """Refuse cameras whose images depend on the time between two of them.

    Raises:
        RunError: naming the camera.
    """
    for camera in vehicle.cameras:
        degradation = camera.sensor.degradation
        shutter = degradation.shutter
        if (shutter is not None and shutter.duration_s) or degradation.is_metered:
            raise RunError(
                f"{path}: has no times, and the exposure of {camera.name} depends on them: "
                "pass --rate HZ"
            )
