"""`omnisim drive`."""

from __future__ import annotations

from omnisim.cli.console import print_note
from omnisim.cli.recording import drive_of, record
from omnisim.cli.run_requests import DriveRequest
from omnisim.simulation.contacts import NO_SIZE, check_no_contact
from omnisim.simulation.route import Route
from omnisim.simulation.vehicle import Vehicle

MOST_CONTACTS = 5  # notes; the manifest has all


def run(request: DriveRequest) -> None:
    """Record a run, or resume an unfinished one, and print a summary."""
    route = Route(
        path=request.path,
        step_m=request.step_m,
        step_deg=request.turn_step_deg,
        rate_hz=request.rate_hz,
        ignore_limits=request.ignore_limits,
        ground_m=request.ground_m,
        axes=None if request.axes is None else request.axes.value,
    )
    drive = drive_of(request, Vehicle.load(request.robot), route)
    plan = drive.plan(print_note)
    if request.no_contact:
        check_no_contact(plan.contacts, request.path)
    if plan.contacts is None:
        print_note(NO_SIZE)
    for contact in (plan.contacts or ())[:MOST_CONTACTS]:
        print_note(str(contact))
    record(plan, request.output, request.force)
