"""Served robots: rates, gaps and latencies of their streams, alone and under attack, and memory.

The servers are the command itself, each in its own process, and so are the attackers; the client is
that of `omnisim.serve.connect`. Only `--fast` is compared with a drive in this process.
"""

from __future__ import annotations

import dataclasses
import json
import multiprocessing
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray
from websockets.exceptions import WebSocketException
from websockets.sync.client import connect as open_socket

from benchmarks.bounds import Limits, reaches_goal
from benchmarks.errors import BenchmarkError
from benchmarks.options import Options
from benchmarks.report import Judged, bound_lines, make_report
from benchmarks.resident_memory import resident_bytes
from benchmarks.timer import MedianInterval, time_interleaved
from omnisim import load_scene
from omnisim.plots import style
from omnisim.rendering.opengl.gl.context import open_context
from omnisim.report.machine import ROOT
from omnisim.robots import load_robot
from omnisim.robots.vehicle import Vehicle
from omnisim.runs.drive import Drive
from omnisim.runs.route import Route
from omnisim.serve import (
    Controls,
    Publisher,
    ServedRobotClient,
    ServeLoop,
    ServeSettings,
    Simulation,
    Topic,
    connect,
)
from omnisim.serve.protocols.plain_publisher import pack_message

SCENE, SIZE_PX, CAMERAS = "soccer", 360, 4
CAMERA_HZ, LIDAR_HZ, IMU_HZ = 6.0, 10.0, 200.0
STREAM_S = 20.0  # of wall-clock time, alone and under attack
FAST_S = 5.0  # of simulated time
MEMORY_S = 90.0  # of wall-clock time, the first third to settle; --full: four times as long
RATES = {  # goals in Hz, by the end of topics
    "compressed": 5.0, "points": 0.99 * LIDAR_HZ, "data_raw": 0.99 * IMU_HZ,
}  # fmt: skip
_SLOW = "half of the goal: no machine on which all at once is of use"
MEDIAN_MS = Limits(bound=600.0, goal=150.0, reason="four times the goal, on a busy machine")
P99_MS = Limits(bound=1200.0, goal=300.0, reason="four times the goal, on a busy machine")
FAST = Limits(bound=0.75, goal=0.9, at_least=True, reason="the goal, less the noise of few rounds")
ATTACKED = Limits(bound=0.75, goal=0.95, at_least=True, reason="attackers take a core, too")
GAPS = Limits(bound=20.0, goal=0.0, reason="a tenth of a second at 200 Hz, in all")
GROWTH_MIB = Limits(bound=64.0, goal=4.0, reason="an hour of a leak of 180 bytes per tick")
_COMMAND = "from omnisim.apps.cli.app import main; main()"
_TIMEOUT_S = 60.0

_BASE = 'extends = "p2at"\nname = "{name}"\n'
_IMU = '[[sensors]]\ntype = "imu"\nname = "imu"\nposition_m = [0.0, 0.0, 0.2]\n'
_CAMERA = (
    '[[sensors]]\ntype = "omnicamera"\nname = "camera_{number}"\nposition_m = [-0.08, {y}, 0.65]\n'
)
_LIDAR = (
    '[[sensors]]\ntype = "lidar"\nname = "lidar"\nposition_m = [0.0, 0.0, 0.8]\nrate_hz = 10.0\n'
)


def run(options: Options) -> dict[str, Any]:
    """Serve robots with many sensors, with one camera, and with an IMU.

    Raises:
        BenchmarkError: the command fails.
        OmnisimError: no OpenGL.
    """
    scene = options.scenes[0] if options.scenes else SCENE
    memory_s = MEMORY_S * (4.0 if options.is_full else 1.0)
    with tempfile.TemporaryDirectory() as folder:
        many, one, none = _robots(Path(folder))
        with _served(scene, many, options) as (address, _):
            alone = _rates(address)
            with _attackers(address):
                attacked = _rates(address)
            loaded = _latencies(address, "camera_1", options.rounds // 3)
        with _served(scene, one, options, "--rate", "30") as (address, _):
            latencies = _latencies(address, "camera_1", options.rounds)
        fast = _fast(scene, many, options)
        with _served(scene, none, options, "--fast") as (address, process):
            memory = _growth(address, process, memory_s)
    kept = min(attacked[topic]["rate_hz"] / row["rate_hz"] for topic, row in alone.items())
    rows: list[dict[str, Any]] = [
        *({"what": topic, **row} for topic, row in alone.items()),
        *({"what": f"{topic}, under attack", **row} for topic, row in attacked.items()),
        _latency_row("command to image, one camera", latencies),
        _latency_row("command to image, all sensors", loaded),
        {"what": "--fast to drive, both with the same sensors", **fast.flat("rate_ratio")},
        {"what": "rates under attack to those without", "rate_ratio": kept},
        {"what": "memory of --fast with an IMU", **memory},
    ]
    context = open_context(options.device)
    judged = _judged(alone, latencies, fast, kept, memory)
    report = make_report("serve", options, context, rows, judged, scene=scene, size_px=SIZE_PX)
    context.release()
    return report


def lines(report: dict[str, Any]) -> list[str]:
    """Text of the report."""
    text = []
    for row in report["rows"]:
        values = [
            f"{key} {value:.4g}" for key, value in row.items() if isinstance(value, int | float)
        ]
        text.append(f"{row['what']:48} {', '.join(values)}")
    return text + bound_lines(report)


def figure(report: dict[str, Any]) -> Figure:
    """Figure of the values relative to their goals."""
    drawn, axes = style.plot(
        f"Served robot, {report['scene']}, {CAMERAS} × {report['size_px']}²", "times the goal", ""
    )
    entries = [entry for entry in report["bounds"] if entry["goal"]]
    for at, entry in enumerate(entries):
        color = style.GREEN if reaches_goal(entry) else style.ORANGE
        axes.barh(at, entry["value"] / entry["goal"], color=color)
    axes.axvline(1.0, color=style.GRAY, linestyle="--")
    names = [f"{entry['name']}, {entry['sense']} {entry['goal']:g}" for entry in entries]
    axes.set_yticks(range(len(names)), names)
    axes.invert_yaxis()
    return drawn


def _robots(folder: Path) -> list[Path]:
    """Robot files: with many sensors, with one camera, and with an IMU."""
    camera = [_CAMERA.format(number=k + 1, y=0.1 * k) for k in range(CAMERAS)]
    timed = [text + f"rate_hz = {CAMERA_HZ}\n" for text in camera]
    contents = {"many": [*timed, _LIDAR, _IMU], "one": camera[:1], "none": [_IMU]}
    files = []
    for name, sensors in contents.items():
        files.append(folder / f"{name}.toml")
        files[-1].write_text(_BASE.format(name=name) + "".join(sensors), encoding="utf-8")
    return files


@contextmanager
def _served(scene: str, robot: Path, options: Options, *more: str) -> Iterator[tuple[str, int]]:
    """Address of a server, and its process."""
    words = ["serve", str(robot), "--scene", scene, "--protocols", "plain", "--port", "0", *more]
    words += ["--size", str(SIZE_PX), "--quality", "fast"]
    if options.device is not None:
        words += ["--device", str(options.device)]
    with subprocess.Popen(
        [sys.executable, "-c", _COMMAND, *words], cwd=ROOT, stdout=subprocess.PIPE, text=True
    ) as process:
        try:
            assert process.stdout is not None
            line = process.stdout.readline()
            address = line.partition("http")[2].strip()
            if not address:
                raise BenchmarkError(f"omnisim serve: expected an address, got {line!r}")
            address = f"ws{address}"
            process.stdout.readline()  # it is ready
            yield address, process.pid
        finally:
            process.terminate()


def _topics() -> list[str]:
    cameras = [f"/camera_{k + 1}/image_raw/compressed" for k in range(CAMERAS)]
    return [*cameras, "/lidar/points", "/imu/data_raw"]


def _rates(address: str) -> dict[str, dict[str, float]]:
    """Rate of each stream while the robot drives in a circle, and messages that are missing."""
    stamps: dict[str, list[float]] = {topic: [] for topic in _topics()}
    with connect(address, _topics()) as robot:
        missing = set(stamps)
        while missing:  # shaders compile
            _drive_for(robot, 1.0, lambda topic, stamp_s: missing.discard(topic))
        _drive_for(robot, 2.0, lambda topic, stamp_s: None)
        dropped = robot.dropped
        seconds = _drive_for(robot, STREAM_S, lambda topic, at: stamps[topic].append(at))
        dropped = robot.dropped - dropped
    rows = {}
    for topic, times_s in stamps.items():
        period_s = 1.0 / (IMU_HZ if "imu" in topic else LIDAR_HZ if "lidar" in topic else CAMERA_HZ)
        steps = np.rint(np.diff(times_s) / period_s)
        rows[topic] = {
            "rate_hz": len(times_s) / seconds,
            "missing": float(np.maximum(0.0, steps - 1.0).sum()),
            "longest_gap_s": float(np.diff(times_s).max(initial=0.0)),
            "dropped_of_all": float(dropped),
        }
    return rows


def _drive_for(
    robot: ServedRobotClient, seconds: float, take: Callable[[str, float], None]
) -> float:
    """Drive in a circle, and take the messages; returns the wall-clock time."""
    begin_s = asked_s = time.perf_counter()
    while (now_s := time.perf_counter()) < begin_s + seconds:
        if now_s >= asked_s:
            robot.command(0.4, 0.5)
            asked_s = now_s + 0.1
        message = robot.next(0.05)
        if message is not None:
            take(message.topic, message.stamp_s)
    return time.perf_counter() - begin_s


def _latencies(address: str, camera: str, rounds: int) -> NDArray[np.float64]:
    """Milliseconds from a command to the first image that differs from those at rest.

    The robot's acceleration is part of it.
    """
    topic, times_ms = f"/{camera}/image_raw/compressed", []
    with connect(address, [topic]) as robot:
        for at in range(max(1, rounds)):
            last = _at_rest(robot)
            begin_s = time.perf_counter()
            robot.command(0.0, 3.0 if at % 2 else -3.0)
            while _image(robot) == last:
                pass
            times_ms.append(1e3 * (time.perf_counter() - begin_s))
            robot.command(0.0, 0.0)
    return np.array(times_ms)


def _image(robot: ServedRobotClient) -> bytes:
    message = robot.next(_TIMEOUT_S)
    if message is None:
        raise BenchmarkError("omnisim serve: no more images")
    return bytes(message.fields["data"])


def _at_rest(robot: ServedRobotClient) -> bytes:
    """Image of the robot at rest, and all images read."""
    last, same, begin_s = b"", 0, time.perf_counter()
    while same < 3:
        if time.perf_counter() > begin_s + _TIMEOUT_S:
            raise BenchmarkError("omnisim serve: the images of a robot at rest differ")
        image = _image(robot)
        same, last = same + 1 if image == last else 0, image
    return last


@contextmanager
def _attackers(address: str) -> Iterator[None]:
    """Clients that read nothing, flood, die and lie, in a process of their own."""
    process = multiprocessing.get_context("spawn").Process(target=_attack, args=(address,))
    process.start()
    try:
        yield
    finally:
        if not process.is_alive():
            raise BenchmarkError("the attackers have ended")
        process.terminate()
        process.join()


def _attack(address: str) -> None:
    """Attack a server until the end of the process."""
    from threading import Thread

    rng = np.random.default_rng(1)
    command = json.dumps({"op": "command", "speed_mps": 0.1, "turn_rate_radps": 0.1})

    def forever(work: Callable[[], object]) -> None:
        while True:
            with suppress(OSError, WebSocketException):
                work()

    def read_nothing() -> None:
        with open_socket(address, max_queue=1, proxy=None) as socket:
            socket.send(json.dumps({"op": "subscribe", "topics": ["*"]}))
            time.sleep(3600.0)

    def flood() -> None:
        with open_socket(address, proxy=None) as socket:
            while True:
                socket.send(command)

    def lie() -> None:
        with open_socket(address, proxy=None) as socket:
            while True:
                socket.send(command[: rng.integers(len(command))])
                socket.send(rng.bytes(60))

    def die() -> None:
        with open_socket(address, proxy=None) as socket:
            socket.socket.close()
        time.sleep(0.1)

    for work in (read_nothing, flood, lie, die):
        Thread(target=forever, args=(work,), daemon=True).start()
    time.sleep(3600.0)


@dataclass
class _Packing(Publisher):
    """Packs what a client of the plain protocol would receive, as drives write all they measure."""

    topics: Sequence[str]
    protocol = "packing"

    def open(self, topics: Sequence[Topic], controls: Controls) -> str:
        """Nothing."""
        return ""

    def wants(self, topic: str) -> bool:
        """True for the benchmark's streams."""
        return topic in self.topics

    def publish(self, topic: str, stamp_ns: int, message: Any) -> None:
        """Pack the message."""
        if topic in self.topics:
            pack_message(topic, stamp_ns, message)

    def close(self) -> None:
        """Nothing."""


def _fast(source: str, robot: Path, options: Options) -> MedianInterval:
    """Simulated time per second of `--fast`, relative to a drive along the same commands."""
    scene = load_scene(source)
    vehicle = Vehicle.from_robot(load_robot(robot)).with_cameras(size_px=SIZE_PX, quality="fast")
    names = {"imu", "lidar", *(f"camera_{k + 1}" for k in range(CAMERAS))}
    sensors = tuple(mount for mount in vehicle.sensors if mount.name in names)
    vehicle = dataclasses.replace(vehicle, sensors=sensors)
    commands = Path(robot.with_name("commands.csv"))

    def served() -> None:
        start = (*scene.start.position_m[:2], np.radians(scene.start.yaw_deg))
        settings = ServeSettings(
            scene, {"robot": vehicle}, {"robot": start}, timeout_s=1e6, device=options.device,
            keeps_commands=True,
        )  # fmt: skip
        simulation = Simulation(settings, [_Packing(_topics())])
        simulation.open()
        simulation.command("", 0.4, 0.5)
        ServeLoop(simulation, "fast", FAST_S).run()
        simulation.close()
        commands.write_text(simulation.commands(""), encoding="utf-8")

    def driven() -> None:
        drive = Drive(scene, vehicle, Route(str(commands), rate_hz=10.0), device=options.device)
        with tempfile.TemporaryDirectory() as folder:
            list(drive.plan().record(Path(folder) / "run"))

    rounds = max(1, options.rounds // 5)
    timings = time_interleaved(
        {"serve": served, "drive": driven}, rounds, 1, options.progress, "--fast and drive"
    )
    return timings.ratio("drive", "serve")


def _growth(address: str, process: int, seconds: float) -> dict[str, float]:
    """Growth of the resident memory, by a line through all but the first third."""
    begin_s, times_s, sizes = time.perf_counter(), list[float](), list[int]()
    with connect(address, ["/odom", "/imu/data_raw"]) as robot:
        while time.perf_counter() < begin_s + seconds:
            now_s = 0.0

            def take(topic: str, stamp_s: float) -> None:
                nonlocal now_s
                now_s = max(now_s, stamp_s)

            _drive_for(robot, 1.0, take)
            times_s.append(now_s)
            sizes.append(resident_bytes(process))
    first = len(times_s) // 3
    hours, mib = np.array(times_s[first:]) / 3600.0, np.array(sizes[first:]) / 2.0**20
    return {
        "growth_mib_per_h": float(np.polyfit(hours, mib, 1)[0]) if len(hours) > 1 else 0.0,
        "simulated_h": float(hours[-1] - hours[0]),
        "measured_mib": float(mib[-1] - mib[0]),
        "most_mib": float(mib.max()),
    }


def _latency_row(what: str, times_ms: NDArray[np.float64]) -> dict[str, Any]:
    return {
        "what": what, "median_ms": float(np.median(times_ms)),
        "p99_ms": float(np.percentile(times_ms, 99.0)), "rounds": len(times_ms),
    }  # fmt: skip


def _judged(
    alone: dict[str, dict[str, float]],
    latencies: NDArray[np.float64],
    fast: MedianInterval,
    kept: float,
    memory: dict[str, float],
) -> list[Judged]:
    judged: list[Judged] = []
    for end, goal in RATES.items():
        slowest = min(row["rate_hz"] for topic, row in alone.items() if topic.endswith(end))
        limits = Limits(bound=0.5 * goal, goal=goal, at_least=True, reason=_SLOW)
        judged.append((f"rate of the slowest …/{end}, Hz", slowest, limits))
    return [
        *judged,
        ("readings of the IMU that are missing", alone["/imu/data_raw"]["missing"], GAPS),
        ("command to image, median ms", float(np.median(latencies)), MEDIAN_MS),
        ("command to image, p99 ms", float(np.percentile(latencies, 99.0)), P99_MS),
        ("--fast to drive", fast, FAST),
        ("slowest rate under attack to that without", kept, ATTACKED),
        ("growth of memory, MiB per simulated hour", memory["growth_mib_per_h"], GROWTH_MIB),
    ]
