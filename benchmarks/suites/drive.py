"""Drive through a scene: variation of frame times, growth of memory, and start-up time.

Beside each frame a constant workload runs: a fill of equally many pixels, on all threads, and a
loop of Python, on one thread. Their variation is the machine's. Processor time, summed over all
threads, is hardly changed by other programs; on a software renderer it shows the variation caused
by the view alone.
"""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.bounds import Limits
from benchmarks.collector_watch import CollectorWatch, watching_the_collector
from benchmarks.errors import BenchmarkError
from benchmarks.options import Options
from benchmarks.probes import fill
from benchmarks.report import Judged, bound_lines, make_report
from benchmarks.resident_memory import resident_bytes
from benchmarks.scenes import load_scenes
from benchmarks.settings import at_setting
from benchmarks.start_up import CACHED, start_up_rows
from benchmarks.suites.drive_figure import drive_figure
from benchmarks.timer import Timings, time_interleaved
from omnisim.rendering.camera.omnicamera import PAPER_POLYGONS
from omnisim.rendering.opengl.gl.context import open_context
from omnisim.rendering.renderer import Renderer
from omnisim.rendering.stage import Stage
from omnisim.robots.vehicle import Vehicle
from omnisim.runs.route import Route, plan_route
from omnisim.scene import Scene

SCENE, ROBOT = "soccer", "p2at"
RATE_HZ = 20.0
JUDGED = "fast"  # the setting whose frames have a bound and a goal
FRAMES = {"fast": 500, "default": 100}
SETTLED = 50  # frames until all constant data is allocated
STARTS = 5
# p99 to p50: of wall-clock time other programs have their part. Of processor time the host of a
# virtual machine has its part, which the constant loop beside each frame shows.
UNEVENNESS = Limits(goal=1.3)
PROCESSOR_UNEVENNESS = Limits(
    bound=1.8, software_only=True,
    reason="1.2 along this path, by the view alone; twice it is work that only some frames do; "
    "a machine whose constant loop varies more than its frames shows none",
)  # fmt: skip
GROWTH_MIB = Limits(
    bound=8.0, goal=1.0,
    reason="Python allocates arenas of 1 MiB; to keep every image would take 170 MiB in 450 frames",
)  # fmt: skip
START_S = Limits(
    bound=12.0, goal=1.5, reason="1.0 to 1.5 s on two processors; none in use is eight times slower"
)
SLOW = 1.3  # times the median
_NEAR = 31  # frames of the running median, which shows the cost of the view
_FILL_SIDE_PX = 512
_LOOP = 20_000
_MIB = 2.0**20
FRAME, ALL_THREADS, ONE_THREAD = "frame", "all threads", "one thread"

figure = drive_figure


@dataclass(frozen=True, eq=False)
class _DriveResult:
    """Measurements of a drive at one setting, by frame."""

    setting: str
    timings: Timings
    collector_s: NDArray[np.float64]
    resident: NDArray[np.int64]  # bytes


def run(
    options: Options, frames: dict[str, int] | None = None, starts: int = STARTS
) -> dict[str, Any]:
    """Measure start-up, then drive.

    Args:
        options: only the first of its scenes is used; rounds are ignored.
        frames: number of frames, by setting.
        starts: number of new processes; 0: none.

    Raises:
        OmnisimError: no OpenGL, a scene that cannot be loaded or has no path, or a process that
            fails.
    """
    frames = FRAMES if frames is None else frames
    name, scene = next(iter(load_scenes(options, (SCENE,)).items()))
    if not scene.paths:
        raise BenchmarkError(f"--scene: expected a scene with a path, got {scene.name}")
    source = options.scenes[0] if options.scenes else SCENE
    started = start_up_rows(source, starts, options)
    driven = [_drive(options, scene, setting, count) for setting, count in frames.items()]
    rows = [_frames_row(one) for one in driven]
    rows += [_memory_row(one) for one in driven]
    rows += started
    context = open_context(options.device)
    report = make_report(
        "drive", options, context, rows, _judged(rows),
        scene=name, robot=ROBOT, path=scene.paths[0].name, rate_hz=RATE_HZ, starts=starts,
        series={one.setting: _series(one) for one in driven},
    )  # fmt: skip
    context.release()
    return report


def lines(report: dict[str, Any]) -> list[str]:
    """Text of the report: frames, memory and start-up."""
    rows = report["rows"]
    text = [f"{'':24} {'frames':>6} {'p50':>8} {'p95':>8} {'p99':>8} {'p99/p50':>8}"]
    for row in _of_kind(rows, "frames"):
        text.append(
            f"{row['setting']:24} {row['rounds']:6} {row['p50_ms']:6.1f}ms {row['p95_ms']:6.1f}ms"
            f" {row['p99_ms']:6.1f}ms {row['p99_to_p50']:8.2f}"
        )
        for name, what in (
            ("without_collector", "without the collector"),
            ("processor", "by processor time"),
            ("all_threads", "constant, all threads"),
            ("one_thread", "constant, one thread"),
        ):
            text.append(f"  {what:56} {row[f'{name}_p99_to_p50']:8.2f}")
        text.append(
            f"  {row['slow']} slower than {SLOW} × p50: {row['slow_by_view']} by the view,"
            f" {row['slow_with_machine']} while the machine was slow,"
            f" {row['slow_with_collector']} with the collector"
            f" ({row['collections']} collections, {row['collector_ms']:.1f} ms in all)"
        )
    for row in _of_kind(rows, "memory"):
        text.append(
            f"memory, {row['setting']}: {row['settled_mib']:.1f} MiB after {row['settled_frames']}"
            f" frames, {row['end_mib']:.1f} MiB after {row['frames']}: {row['growth_mib']:+.2f} MiB"
        )
    for row in _of_kind(rows, "start-up"):
        text.append(
            f"start-up, {row['what']}: {row['seconds']:.2f} s"
            f" ({row['processor_seconds']:.2f} s of the processor)"
        )
    for row in _of_kind(rows, "start-up phase"):
        text.append(f"  {row['what']:20} {row['seconds']:6.3f} s")
    return text + bound_lines(report)


def _of_kind(rows: Iterable[dict[str, Any]], kind: str) -> list[dict[str, Any]]:
    return [row for row in rows if row["kind"] == kind]


def _drive(options: Options, scene: Scene, setting: str, frames: int) -> _DriveResult:
    vehicle = Vehicle.load(ROBOT).with_cameras(polygons=PAPER_POLYGONS)
    mounted = vehicle.camera()
    poses = plan_route(
        scene, vehicle, Route(scene.paths[0].name, rate_hz=RATE_HZ)
    ).trajectory.world_from_base
    warm_up = min(options.warm_up, frames)
    drive = np.arange(-warm_up, frames) % len(poses)
    collector_s, resident = np.zeros(len(drive)), np.zeros(len(drive), dtype=np.int64)
    with ExitStack() as stack:
        watch = stack.enter_context(watching_the_collector())
        context = open_context(options.device)
        stack.callback(context.release)
        constant = fill.fill_probes(context, _FILL_SIDE_PX)[-1]
        stage = stack.enter_context(Stage(scene, vehicle.body, device=options.device))
        renderer = stack.enter_context(
            stage.open(at_setting(mounted.sensor, setting), hidden=mounted.hides)
        )
        step = _Step(renderer, poses[drive], watch, collector_s, resident)
        timings = time_interleaved(
            {FRAME: step, ALL_THREADS: constant.work, ONE_THREAD: _loop},
            frames, warm_up, options.progress, f"drive, {setting}",
        )  # fmt: skip
    return _DriveResult(setting, timings, collector_s[warm_up:], resident[warm_up:])


class _Step:
    """Renders the next frame of a drive, and records collector time and memory."""

    def __init__(
        self,
        renderer: Renderer,
        poses: NDArray[np.float64],
        watch: CollectorWatch,
        collector_s: NDArray[np.float64],
        resident: NDArray[np.int64],
    ):
        self._renderer, self._poses, self._watch = renderer, poses, watch
        self._collector_s, self._resident = collector_s, resident
        self._at = 0

    def __call__(self) -> None:
        at, before = self._at, self._watch.seconds
        self._renderer.render(self._poses[at])
        self._collector_s[at] = self._watch.seconds - before
        self._resident[at] = resident_bytes()
        self._at += 1


def _loop() -> int:
    total = 0
    for number in range(_LOOP):
        total += number
    return total


def _frames_row(driven: _DriveResult) -> dict[str, Any]:
    timings = driven.timings
    seconds = timings.seconds[FRAME]
    busy = timings.processor_seconds[FRAME]
    constant = timings.processor_seconds[ONE_THREAD]
    view = running_median(busy)
    machine = timings.seconds[ALL_THREADS]
    slow = seconds > SLOW * np.median(seconds)
    by_view = slow & (view > SLOW * np.median(busy))
    with_collector = slow & (seconds - driven.collector_s <= SLOW * np.median(seconds))
    with_machine = slow & (machine > SLOW * np.median(machine))
    return {
        "kind": "frames", "setting": driven.setting, "rounds": len(seconds),
        **timings.row(FRAME),
        "p99_to_p50": unevenness(seconds),
        "without_collector_p99_to_p50": unevenness(seconds - driven.collector_s),
        "processor_p99_to_p50": unevenness(busy),
        "all_threads_p99_to_p50": unevenness(machine),
        "one_thread_p99_to_p50": unevenness(timings.seconds[ONE_THREAD]),
        "processor_to_machine": unevenness(busy) / max(1.0, unevenness(constant)),
        "slow": int(slow.sum()), "slow_by_view": int(by_view.sum()),
        "slow_with_collector": int(with_collector.sum()),
        "slow_with_machine": int(with_machine.sum()),
        "collections": int(np.count_nonzero(driven.collector_s)),
        "collector_ms": 1e3 * float(driven.collector_s.sum()),
    }  # fmt: skip


def unevenness(seconds: NDArray[np.float64]) -> float:
    """Ratio of the 99th percentile to the median."""
    middle, high = np.percentile(seconds, (50, 99))
    return float(high / middle)


def running_median(seconds: NDArray[np.float64]) -> NDArray[np.float64]:
    """Running median (n,) of the seconds of neighboring frames."""
    half = min(_NEAR // 2, len(seconds) - 1)
    around = np.pad(seconds, half, mode="reflect")
    return np.median(np.lib.stride_tricks.sliding_window_view(around, 2 * half + 1), axis=-1)


def _memory_row(driven: _DriveResult) -> dict[str, Any]:
    settled = min(SETTLED, len(driven.resident)) - 1
    held = driven.resident / _MIB
    return {
        "kind": "memory", "setting": driven.setting,
        "frames": len(held), "settled_frames": settled + 1,
        "settled_mib": float(held[settled]), "end_mib": float(held[-1]),
        "most_mib": float(held.max()), "growth_mib": float(held[-1] - held[settled]),
    }  # fmt: skip


def _judged(rows: list[dict[str, Any]]) -> list[Judged]:
    judged: list[Judged] = []
    for row in _of_kind(rows, "frames"):
        if row["setting"] == JUDGED:
            name = f"p99 to p50 of {row['rounds']} frames, {JUDGED}"
            judged.append((name, row["p99_to_p50"], UNEVENNESS))
            judged.append(
                (
                    f"{name}, processor, to a loop's",
                    row["processor_to_machine"],
                    PROCESSOR_UNEVENNESS,
                )
            )
    for row in _of_kind(rows, "memory"):
        name = f"growth after frame {row['settled_frames']}, {row['setting']}, MiB"
        judged.append((name, row["growth_mib"], GROWTH_MIB))
    for row in _of_kind(rows, "start-up"):
        if row["what"] == CACHED:
            judged.append(("start to first image, s", row["seconds"], START_S))
    return judged


def _series(driven: _DriveResult) -> dict[str, list[float]]:
    """Milliseconds by frame, for the figure."""
    seconds = {name: driven.timings.seconds[name] for name in (FRAME, ALL_THREADS, ONE_THREAD)}
    seconds["collector"] = driven.collector_s
    seconds["processor"] = driven.timings.processor_seconds[FRAME]
    return {name: np.round(1e3 * values, 3).tolist() for name, values in seconds.items()}
