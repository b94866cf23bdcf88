"""`omnisim drive`."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from pathlib import Path

from omnisim.apps.cli.console import print_note
from omnisim.apps.cli.images.recording import as_requested, drive_of, record
from omnisim.apps.cli.runs.requests import DriveRequest
from omnisim.core.errors import RunError
from omnisim.core.extras import require_extra
from omnisim.robots import Robot, load_robot
from omnisim.robots.importers.importers import SUFFIXES, load_robot_model
from omnisim.robots.vehicle import Vehicle
from omnisim.runs.contacts import NO_SIZE, check_no_contact
from omnisim.runs.drive import PlannedDrive, drive_together, plan_together
from omnisim.runs.route import Route
from omnisim.sensors.sensor_names import FOLDER_NAME, folder_name

NO_SENSORS = (
    "has no sensors: nothing but its path and odometry is recorded: give its robot file [[sensors]]"
)
MAX_CONTACTS = 5  # maximum number of printed contacts; the manifest has all


def run(request: DriveRequest) -> None:
    """Record a run of each robot, or resume an unfinished one, and print a summary."""
    robots, vehicles = _load_robots(request)
    _check_cameras(request, vehicles)
    routes = [_route(request, path) for path in request.paths]
    first = drive_of(request, next(iter(vehicles.values())), routes[0])
    drives = {
        name: dataclasses.replace(
            first,
            vehicle=as_requested(vehicle, request.image),
            route=route,
            physics=None if request.way.physics is None else robots[name].chassis,
        )
        for (name, vehicle), route in zip(vehicles.items(), routes, strict=True)
    }
    plans = plan_together(drives, print_note)
    for name, plan in plans.items():
        _report(plan, f"{name}: " if len(plans) > 1 else "", request.way.no_contact)
    if len(plans) == 1:
        record(next(iter(plans.values())), request.output, request.force)
        return
    _make_folder(request.output)
    for name, plan in drive_together(plans).items():
        record(plan, request.output / name, request.force)


def _load_robots(request: DriveRequest) -> tuple[dict[str, Robot], dict[str, Vehicle]]:
    """Robots and their vehicles by name, which is also the name of their folder."""
    if request.way.physics is not None:
        require_extra("mujoco", "--physics", RunError)
    if len(request.paths) != len(request.robots):
        raise RunError(
            f"--path: expected one for each --robot, {len(request.robots)}, got "
            f"{len(request.paths)}"
        )
    robots: dict[str, Robot] = {}
    vehicles: dict[str, Vehicle] = {}
    for text in request.robots:
        given, equals, source = text.rpartition("=")
        robot, vehicle = _load_robot(source, request.world.resources or ())
        name = given if equals else folder_name(robot.name)
        if not FOLDER_NAME.fullmatch(name):
            raise RunError(f"--robot {text!r}: expected a name of letters, digits and _ before =")
        if name in robots:
            raise RunError(f"--robot {text!r}: a second {name}: expected NAME={source}")
        robots[name], vehicles[name] = robot, vehicle
    return robots, vehicles


def _load_robot(source: str, resources: Sequence[Path]) -> tuple[Robot, Vehicle]:
    """Load a robot file or a simulator's model."""
    if Path(source).suffix.lower() not in SUFFIXES:
        robot = load_robot(source)
        return robot, Vehicle.from_robot(robot)
    loaded = load_robot_model(Path(source), resources)
    for notice in loaded.notices:
        print_note(f"{source}: {notice}")
    for notice in () if loaded.vehicle.body is None else loaded.vehicle.body.notices:
        print_note(notice)
    return loaded.robot, loaded.vehicle


def _check_cameras(request: DriveRequest, vehicles: dict[str, Vehicle]) -> None:
    """Raise an error if ground truth or an exposure is requested but no robot has a camera."""
    option = "--also" if request.truth.also else "--boxes-3d" if request.truth.boxes_3d else None
    if option is None and request.image.exposure_ev is not None:
        option = "--exposure-ev"
    sensors = (one for vehicle in vehicles.values() for one in vehicle.sensors)
    if option and not any(sensor.has_ground_truth for sensor in sensors):
        raise RunError(f"{option}: expected a robot with a camera, got {', '.join(vehicles)}")


def _route(request: DriveRequest, path: str) -> Route:
    return Route(
        path=path,
        step_m=request.way.step_m,
        step_deg=request.way.turn_step_deg,
        rate_hz=request.way.rate_hz,
        ignore_limits=request.way.ignore_limits,
        ground_m=request.way.ground_m,
        axes=None if request.way.axes is None else request.way.axes.value,
    )


def _report(plan: PlannedDrive, whose: str, no_contact: bool) -> None:
    """Print the contacts and notes of a planned drive."""
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


def _make_folder(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as reason:
        raise RunError(f"{folder}: cannot be created: {reason.strerror}") from None
