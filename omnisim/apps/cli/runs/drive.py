"""`omnisim drive` and `omnisim record`: runs of robots along paths, and of rigs along poses."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from omnisim.apps.cli import inputs
from omnisim.apps.cli.console import out, pluralize, print_note, progress, resumable
from omnisim.apps.cli.option_groups import MeshImageOptions
from omnisim.apps.cli.options import refuse_given
from omnisim.apps.cli.runs.requests import DriveRequest, RecordRequest, RigOptions
from omnisim.cameras import NonCentralCamera
from omnisim.core.errors import OutputError, RunError
from omnisim.core.extras import require_extra
from omnisim.core.files.image_files import EIGHT_BIT_SUFFIXES, FLOAT_SUFFIXES
from omnisim.core.files.sources import recorded_sources, source_digest
from omnisim.core.poses import pose
from omnisim.core.short_repr import point_text
from omnisim.ground_truth import parse_channels
from omnisim.robots import Robot, load_robot
from omnisim.robots.importers.importers import SUFFIXES, load_robot_model
from omnisim.robots.vehicle import Vehicle
from omnisim.runs.contacts import NO_SIZE, check_no_contact
from omnisim.runs.drive import Drive, PlannedDrive, drive_together, plan_together
from omnisim.runs.route import Route, route_digest
from omnisim.sensors.sensor_table import FOLDER_NAME, folder_name

if TYPE_CHECKING:  # needed by rigs only
    from omnisim.cameras.calibration.calibration import Rig

NO_SENSORS = (
    "has no sensors: only its path and odometry are recorded: add [[sensors]] to its robot file"
)
MAX_CONTACTS = 5  # maximum number of printed contacts; the manifest has all


def drive(request: DriveRequest) -> None:
    """Record a run of each robot, or resume an unfinished one, and print a summary."""
    way, truth = request.way, request.truth
    if way.physics is not None:
        require_extra("mujoco", "--physics", RunError)
    if (count := len(request.paths)) != len(request.robots):
        expected = f"expected {len(request.robots)}, one for each --robot"
        raise RunError(f"--path: {expected}, got {count}")
    robots, vehicles = load_robots(request.robots, request.world.resources or ())
    option = "--also" if truth.also else "--boxes-3d" if truth.boxes_3d else None
    if option is None and request.image.exposure_ev is not None:
        option = "--exposure-ev"
    sensors = (mount.sensor for vehicle in vehicles.values() for mount in vehicle.sensors)
    if option and not any(sensor.has_ground_truth for sensor in sensors):
        raise RunError(f"{option}: expected a robot with a camera, got {', '.join(vehicles)}")
    steps = way.step_m, way.turn_step_deg, way.rate_hz, way.ignore_limits, way.ground_m, way.axes
    routes = [Route(path, *steps) for path in request.paths]
    first = _drive_of(request, next(iter(vehicles.values())), routes[0])
    drives = {  # the scene is loaded once, by the first
        name: dataclasses.replace(
            first,
            vehicle=as_requested(vehicle, request.image),
            route=route,
            physics=None if way.physics is None else robots[name].chassis,
        )
        for (name, vehicle), route in zip(vehicles.items(), routes, strict=True)
    }
    plans = plan_together(drives, print_note)
    for name, plan in plans.items():
        _print_notes(plan, f"{name}: " if len(plans) > 1 else "", way.no_contact)
    if len(plans) == 1:
        _record(next(iter(plans.values())), request.output, request.force)
        return
    try:
        request.output.mkdir(parents=True, exist_ok=True)
    except OSError as reason:
        raise RunError(f"{request.output}: cannot be created: {reason.strerror}") from None
    for name, plan in drive_together(plans).items():
        _record(plan, request.output / name, request.force)


def load_robots(
    sources: Sequence[str], resources: Sequence[Path], option: str = "--robot"
) -> tuple[dict[str, Robot], dict[str, Vehicle]]:
    """Robot files, and the robots with body and sensors made of them, by the name of their folder.

    Each source is NAME=SOURCE, or a source, which has a name itself. `resources` are the search
    folders of models; messages call a source `option`.
    """
    robots: dict[str, Robot] = {}
    vehicles: dict[str, Vehicle] = {}
    for text in sources:
        given, equals, source = text.rpartition("=")
        if Path(source).suffix.lower() in SUFFIXES:  # a simulator's model
            loaded = load_robot_model(Path(source), resources)
            robot, vehicle = loaded.robot, loaded.vehicle
            for notice in loaded.notices:
                print_note(f"{source}: {notice}")
            for notice in () if vehicle.body is None else vehicle.body.notices:
                print_note(notice)
        else:
            robot = load_robot(source)
            vehicle = Vehicle.from_robot(robot)
        name = given if equals else folder_name(robot.name)
        if not FOLDER_NAME.fullmatch(name):
            raise RunError(f"{option} {text!r}: expected a name of letters, digits and _ before =")
        if name in robots:
            raise RunError(f"{option} {text!r}: a second {name}: expected NAME={source}")
        robots[name], vehicles[name] = robot, vehicle
    return robots, vehicles


def _print_notes(plan: PlannedDrive, whose: str, no_contact: bool) -> None:
    """Print notes about a plan; if contacts are forbidden, reject them."""
    if not plan.drive.vehicle.sensors:
        print_note(f"{plan.drive.vehicle.name} {NO_SENSORS}")
    if no_contact:
        check_no_contact(plan.contacts, plan.drive.route.path)
    if plan.contacts is None:
        print_note(f"{whose}{NO_SIZE}")
    for contact in (plan.contacts or ())[:MAX_CONTACTS]:
        print_note(f"{whose}{contact}")
    for note in plan.notes:
        print_note(f"{whose}{note}")
    if plan.simulated is not None:
        print_note(f"{whose}{plan.simulated.engine}: {plan.simulated.slip}")


def record(request: RecordRequest) -> None:
    """Record a run of a rig, or resume an unfinished one, and print a summary."""
    from omnisim.runs.rig_trajectory import RigRoute

    poses, path = request.poses, request.poses.trajectory
    if request.output.suffix.lower() in EIGHT_BIT_SUFFIXES + FLOAT_SUFFIXES:
        raise OutputError(f"{request.output}: expected a folder, got an image")
    with recorded_sources() as sources:
        rig, vehicle = _rig(request.camera, path)
    if vehicle.given is None:  # not a robot's, which its own files identify
        choice = request.camera.camera_name, request.camera.mirrored
        vehicle = vehicle.identified(source_digest(sources.digest(path.parent), choice))
    world_from_file = pose(
        poses.at or (0.0, 0.0, 0.0),
        roll_deg=poses.roll_deg, pitch_deg=poses.pitch_deg, yaw_deg=poses.yaw_deg or 0.0,
    )  # fmt: skip
    route = RigRoute(path, poses.trajectory_frame, poses.axes, poses.rate_hz, world_from_file)
    truth, is_timed = route.read(rig, print_note)
    run = _drive_of(request, vehicle, Route(str(path)))
    for camera in () if is_timed else run.vehicle.cameras:
        degradation, shutter = camera.sensor.degradation, camera.sensor.degradation.shutter
        if (shutter is not None and shutter.duration_s) or degradation.is_metered:
            raise RunError(
                f"{path}: has no times, and the exposure of {camera.name} depends on them: "
                "pass --rate HZ"
            )
    low, high = run.scene.bounds_m()
    outside = ((truth.positions_m < low) | (truth.positions_m > high)).any(axis=1)
    if outside.any():  # often by a misplaced origin
        corners = (point_text(corner, 4) for corner in (low, high))
        print_note(
            f"{path}: {int(outside.sum())} of {pluralize(len(truth), 'pose')} outside the scene, "
            f"which spans {' to '.join(corners)} m; --at, --yaw, --pitch and --roll set the file's "
            "origin"
        )
    placing = poses.at, poses.roll_deg, poses.pitch_deg, poses.yaw_deg
    options = placing, poses.trajectory_frame, poses.axes, poses.rate_hz
    plan = run.along(truth, source_digest(route_digest(run.route), options)[:16])
    for note in plan.notes:
        print_note(note)
    _record(plan, request.output, request.force)


def _rig(camera: RigOptions, path: Path) -> tuple[Rig, Vehicle]:
    """Rig with all cameras named by the poses, and vehicle of the selected cameras."""
    # formats and fits of calibrations take time to import
    from omnisim.apps.cli.cameras.calibration import read_calibration
    from omnisim.cameras.calibration.calibration import Rig, RigCamera
    from omnisim.robots.vehicle import rig_vehicle

    if camera.robot is not None:
        reason = "expected none with --robot, whose sensors record"
        others = "sensor", "calibration_file", "camera_name", "optics", "mirrored"
        refuse_given(camera, reason, *others)
        vehicle = Vehicle.load(camera.robot)
        cameras = (
            RigCamera(mount.name, mount.sensor.model, mount.sensor.base_from_optical)
            for mount in vehicle.cameras
            if not isinstance(mount.sensor.model, NonCentralCamera)
        )
        return Rig("base", tuple(cameras)), vehicle
    source = camera.calibration_file
    own_camera = camera.sensor or camera.optics
    if source is None and own_camera is None and path.suffix.lower() == ".json":
        source = path  # nerfstudio's files have poses and calibration
    if source is None or camera.optics is not None:
        sensor = inputs.read_camera(camera, source)
        rig = Rig("base", (RigCamera("camera", sensor.model, sensor.base_from_optical),))
        name = "camera" if own_camera is None else own_camera.stem
        return rig, rig_vehicle(name, rig, (sensor,))
    inputs.check_calibration_path(source, camera.sensor)
    calibration = read_calibration(source, None, None, camera.mirrored)
    selected = None if camera.camera_name == "all" else camera.camera_name
    rig = Rig.of(calibration, selected)
    return rig, rig_vehicle(source.stem, rig if selected is None else rig.only(selected))


def _drive_of(request: DriveRequest | RecordRequest, vehicle: Vehicle, route: Route) -> Drive:
    """Drive of a vehicle, with the scene and the settings of a request."""
    world, light, truth = request.world, request.light, request.truth
    channels = () if truth.also is None else parse_channels(truth.also)
    scene = inputs.load_labeled_scene(world, light, truth, channels)
    backend = inputs.checked_backend(request.gpu)
    if vehicle.cameras and not light.unlit:
        sensors = [camera.sensor for camera in vehicle.cameras]
        inputs.note_lighting(world.scene, scene, backend, sensors)
    return Drive(
        scene,
        as_requested(vehicle, request.image),
        route,
        seed=request.seed,
        unlit=light.unlit,
        device=request.gpu.device,
        backend=backend,
        up_axis=world.up_axis,
        meters_per_unit=world.meters_per_unit,
        resources=tuple(world.resources or ()),
        channels=channels,
        boxes_3d=truth.boxes_3d,
        channel_format=inputs.parse_channel_format(truth.channel_format, channels),
    )


def as_requested(vehicle: Vehicle, image: MeshImageOptions) -> Vehicle:
    """Vehicle with cameras as the image options ask."""
    return vehicle.with_cameras(
        size_px=image.size_px,
        polygons="same" if image.polygons is None else inputs.parse_polygons(image.polygons),
        degradation=inputs.read_preset(image.preset),
        exposure=image.exposure_ev,
        quality=image.quality,
    )


def _record(plan: PlannedDrive, folder: Path, force: bool) -> None:
    title, done, total = f"{plan.drive.vehicle.name} in {plan.drive.scene.name}", 0, len(plan.truth)
    command = "the same command without --force" if force else "the same command"

    def state() -> str:
        steps_done = f"{done} of {total} steps are done"
        return f"{folder}: {steps_done}: run {command} to resume" if done else ""

    with progress(title, total, "steps") as show, resumable(state):
        steps = plan.record(folder, force)
        before = done = next(steps)  # by an interrupted run
        show(done, "")
        for done in steps:
            show(done, "")
    objects = len(plan.contacts or ())
    touched = f"; contact with {pluralize(objects, 'object')}" if objects else ""
    summaries = ((each.name, each.sensor.mesh_summary) for each in plan.drive.vehicle.cameras)
    meshes = "".join(f"; {name}: {mesh}" for name, mesh in summaries if mesh != "exact")
    resumed = f", {before} of them recorded before" if before else ""
    out.print(
        f"{folder}: {pluralize(done, 'step')}{resumed}; "
        f"{plan.truth.path_length_m:.2f} m in {plan.truth.duration_s:.1f} s{meshes}{touched}"
    )
