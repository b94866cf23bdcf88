"""`omnisim serve`: simulated robots as live streams."""

from __future__ import annotations

import math
import re
import signal
import sys
from contextlib import ExitStack
from pathlib import Path

from omnisim.apps.cli import inputs
from omnisim.apps.cli.console import out, print_note
from omnisim.apps.cli.options import refuse_given
from omnisim.apps.cli.runs.drive import as_requested, load_robots
from omnisim.apps.cli.runs.requests import ClockOptions, ServeRequest, StreamOptions
from omnisim.core.errors import OutputError, did_you_mean
from omnisim.core.extras import require_extra
from omnisim.core.files.atomic_file import check_suffix, check_target, write_text
from omnisim.robots.vehicle import Vehicle
from omnisim.scene import Scene, read_scene
from omnisim.serve.publisher import Publisher

SCENE = "soccer"
CHANNELS = ("range", "semantic", "instance")
APART_M = 1.5  # between robots that have no start of their own in the scene


def run(request: ServeRequest) -> None:
    """Serve robots, or a run, until Ctrl-C, SIGTERM or the given duration."""
    require_extra("ros", "omnisim serve")  # its messages
    from omnisim.serve.run_player import RunPlayer, is_run
    from omnisim.serve.serve_loop import ClockMode, ServeLoop
    from omnisim.serve.served_world import Served, ServeSettings, Simulation

    clock, streams = request.clock, request.streams
    if clock.fast and clock.lockstep:
        raise OutputError("--fast, --lockstep: expected one of them")
    mode: ClockMode = "fast" if clock.fast else "lockstep" if clock.lockstep else "wall"
    served: Served
    if len(request.sources) == 1 and is_run(Path(request.sources[0])):
        reason = "expected none with a run, which has its own"
        refuse_given(request, reason, "scene", "also", "seed")
        refuse_given(clock, reason, "at", "yaw_deg", "rate_hz", "timeout_s")
        refuse_given(streams, reason, "commands")
        for options in (request.image, request.light, request.files):
            refuse_given(options, reason)
        served = RunPlayer(Path(request.sources[0]), streams.cloud_layout)
    else:
        if streams.commands is not None:
            check_suffix(streams.commands, ".csv")
            check_target(streams.commands)  # not after an hour of driving
        channels = tuple(filter(None, (request.also or "").split(",")))
        for channel in channels:
            if channel not in CHANNELS:
                raise OutputError(f"--also {channel}: {did_you_mean(channel, CHANNELS)}")
        _, vehicles = load_robots(request.sources, request.files.resources or (), "robot")
        scene = _scene(request)
        served = Simulation(
            ServeSettings(
                scene,
                {name: as_requested(vehicle, request.image) for name, vehicle in vehicles.items()},
                _starts(scene, vehicles, clock),
                clock.rate_hz,
                request.seed,
                clock.timeout_s,
                channels,
                streams.cloud_layout,
                request.light.unlit,
                request.gpu.device,
                inputs.checked_backend(request.gpu),
                keeps_commands=streams.commands is not None,
            )
        )
    loop = ServeLoop(served, mode, clock.duration_s)
    served.publishers += _publishers(streams, mode == "lockstep")
    with ExitStack() as stack:
        stack.callback(served.close)
        served.open()
        for publisher in served.publishers:
            stack.callback(publisher.close)
            out.print(publisher.open(served.topics, loop))
        served.announce()
        out.print(f"{len(served.topics)} topics of {', '.join(loop.robots)}; Ctrl-C ends it.")
        sys.stdout.flush()
        for number in (signal.SIGINT, signal.SIGTERM):
            stack.callback(signal.signal, number, signal.signal(number, lambda *_: loop.end()))
        loop.run()
        if streams.commands is not None and isinstance(served, Simulation):
            text = served.commands("")
            write_text(streams.commands, text)
            for line in re.findall(r"^# (.*)$", text, re.MULTILINE):
                print_note(f"{streams.commands}: {line}")
            out.print(f"{streams.commands}: commands of {loop.robots[0]}")
    late = f"; {loop.late_s:.1f} s of the wall clock left out" if loop.late_s else ""
    out.print(f"stopped at {served.now_s:.2f} s{late}{served.summary()}")


def _scene(request: ServeRequest) -> Scene:
    files, light = request.files, request.light
    units = files.up_axis, files.meters_per_unit, files.resources or ()
    scene = read_scene(request.scene or SCENE, *units, sky=light.sky, baked=light.baked)
    for notice in scene.notices:
        print_note(notice)
    return inputs.with_shadows_as_requested(scene, light)


def _starts(
    scene: Scene, vehicles: dict[str, Vehicle], clock: ClockOptions
) -> dict[str, tuple[float, float, float]]:
    """Starts of the robots: the scene's, then one beside the other."""
    starts = [(*start.position_m[:2], math.radians(start.yaw_deg)) for start in scene.starts]
    first = scene.start
    starts = starts or [(*first.position_m[:2], math.radians(first.yaw_deg))]
    x, y, yaw = starts[0]
    if clock.at is not None:
        x, y = clock.at
    if clock.yaw_deg is not None:
        yaw = math.radians(clock.yaw_deg)
    starts[0] = x, y, yaw
    while len(starts) < len(vehicles):
        x, y, yaw = starts[-1]
        starts.append((x - APART_M * math.sin(yaw), y + APART_M * math.cos(yaw), yaw))
    return dict(zip(vehicles, starts, strict=False))


def _publishers(streams: StreamOptions, keeps_all: bool) -> list[Publisher]:
    """Servers of the protocols, and the recorder."""
    found: list[Publisher] = []
    port = streams.port
    names = streams.protocols.split(",")
    if streams.router is not None and "ros2" not in names:
        raise OutputError("--router: expected ros2 among --protocols")
    for name in names:
        if name == "foxglove":
            from omnisim.serve.protocols.foxglove_publisher import FoxglovePublisher

            found.append(FoxglovePublisher(streams.host, port))
        elif name == "plain":
            from omnisim.serve.protocols.plain_publisher import PlainPublisher

            found.append(PlainPublisher(streams.host, port, keeps_all))
        elif name == "ros2":
            from omnisim.serve.protocols.zenoh_publisher import ROUTER, ZenohPublisher

            found.append(ZenohPublisher(streams.router or ROUTER))
            continue
        else:
            expected = did_you_mean(name, ("foxglove", "plain", "ros2"))
            raise OutputError(f"--protocols {name}: {expected}")
        port += port > 0
    if streams.record is not None:
        from omnisim.serve.protocols.mcap_recorder import McapRecorder

        check_suffix(streams.record, ".mcap")
        found.insert(0, McapRecorder(streams.record))  # refuses an existing file, before all else
    return found
