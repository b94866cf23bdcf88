"""`omnisim robot check`."""

from __future__ import annotations

from rich.console import Console

from omnisim.cli.robot_list import drive_words
from omnisim.robot import OdometryErrors, find_robot, read_robot
from omnisim.simulation import Vehicle
from omnisim.simulation.vehicle import MountedCamera, MountedScanner


def run(source: str, out: Console, err: Console) -> None:
    """Load a robot whole and say what it is.

    Raises:
        OmnisimError: anything that the user can put right.
    """
    robot = read_robot(find_robot(source))
    vehicle = Vehicle.from_robot(robot)
    if vehicle.body is not None:
        for notice in vehicle.body.notices:
            err.print("note: ", notice, sep="", markup=False)
    for line in (f"{source}: good", *(f"  {line}" for line in _lines(vehicle, robot.body))):
        out.print(line, markup=False)


def _lines(vehicle: Vehicle, body: str | None) -> list[str]:
    lines = [f"robot    {vehicle.name}, {vehicle.title}"]
    if vehicle.body is None:
        lines.append("body     none")
    else:
        nodes = len({instance.name for instance in vehicle.body.instances})
        lines.append(f"body     {body}, {vehicle.body.triangle_count} triangles, {nodes} nodes")
    lines.append(f"drive    {drive_words(vehicle.kinematics)}")
    perfect = vehicle.odometry == OdometryErrors()
    lines.append(f"wheels   {'report the truth' if perfect else 'report with errors'}")
    if vehicle.footprint is not None:
        size = vehicle.footprint
        lines.append(f"size     {size.length_m:g} × {size.width_m:g} × {size.height_m:g} m")
    return [*lines, *map(_camera_line, vehicle.cameras), *map(_scanner_line, vehicle.scanners)]


def _camera_line(mounted: MountedCamera) -> str:
    camera = mounted.sensor.model
    return (
        f"camera   {mounted.name}, {camera.width_px} × {camera.height_px} px, "
        f"effective viewpoint {_place(mounted)}"
    )


def _scanner_line(mounted: MountedScanner) -> str:
    scanner = mounted.scanner
    return (
        f"scanner  {mounted.name}, {scanner.beams} beams at {scanner.resolution_deg:.4g}° "
        f"to {scanner.range_max_m:g} m, origin {_place(mounted)}"
    )


def _place(mounted: MountedCamera | MountedScanner) -> str:
    x, y, z = mounted.origin_m.tolist()
    hidden = f", does not see {', '.join(mounted.hides)}" if mounted.hides else ""
    return f"({x:g}, {y:g}, {z:g}) m{hidden}"
