"""`omnisim drive`."""

from __future__ import annotations

from omnisim.cli.console import print_note
from omnisim.cli.inputs import (
    load_labelled_scene,
    parse_channel_format,
    parse_polygons,
    read_preset,
)
from omnisim.cli.recording import record
from omnisim.cli.run_requests import DriveRequest
from omnisim.ground_truth import parse_channels
from omnisim.simulation.contacts import NO_SIZE, check_no_contact
from omnisim.simulation.drive import Drive
from omnisim.simulation.route import Route
from omnisim.simulation.vehicle import Vehicle

MOST_CONTACTS = 5  # notes; the manifest has all


def run(request: DriveRequest) -> None:
    """Record a run, or resume an unfinished one, and print a summary."""
    channels = () if request.also is None else parse_channels(request.also)
    scene = load_labelled_scene(
        request.scene, request.up_axis, request.labels, channels, request.boxes_3d
    )
    vehicle = Vehicle.load(request.robot).with_cameras(
        size_px=request.size_px,
        polygons="same" if request.polygons is None else parse_polygons(request.polygons),
        degradation=read_preset(request.preset),
        quality=request.quality,
    )
    route = Route(
        path=request.path,
        step_m=request.step_m,
        step_deg=request.turn_step_deg,
        rate_hz=request.rate_hz,
        ignore_limits=request.ignore_limits,
        ground_m=request.ground_m,
        axes=None if request.axes is None else request.axes.value,
    )
    drive = Drive(
        scene,
        vehicle,
        route,
        seed=request.seed,
        unlit=request.unlit,
        device=request.device,
        up_axis=request.up_axis,
        channels=channels,
        boxes_3d=request.boxes_3d,
        channel_format=parse_channel_format(request.channel_format, channels),
    )
    plan = drive.plan(print_note)
    if request.no_contact:
        check_no_contact(plan.contacts, request.path)
    if plan.contacts is None:
        print_note(NO_SIZE)
    for contact in (plan.contacts or ())[:MOST_CONTACTS]:
        print_note(str(contact))
    record(plan, request.output, request.force)
