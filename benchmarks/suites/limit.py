"""Roofline of a frame: the times of its parts, and their lower bounds on this machine.

Scenes are rendered without baked light, which the empty room does not have.

The machine's rates are probed in the same rounds. The lower bound of a frame is the sum of its
parts, each at the rate of its probe:

- the texels of the virtual cameras, each shaded once, at the rate of an empty room with the
  scene's lights;
- the submitted triangles: visible ones at the rate of small visible triangles, all others at the
  rate of back faces or of triangles outside of the image;
- one bilinear lookup per sample of the mirror, in an atlas of half floats;
- readback of the image's bytes.

It is not a physical limit. Overdraw and Python's work count as avoidable; shading a texel does not.
Probes and frames are interleaved on a machine that runs other programs, too. On a software
renderer, the share by processor time is the more reliable one.

The processor's part of a frame is measured in a process whose driver draws nothing, for single
frames and for batches.

A frame with tiny faces, which have almost nothing to fill, shows the share of triangles and calls
in the time of the virtual cameras.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from typing import Any

import moderngl
import numpy as np

from benchmarks.bounds import Limits
from benchmarks.idle_driver import BATCH, BATCH_PX, FRAME_PX, idle_driver_rows
from benchmarks.options import Options
from benchmarks.probes import fill, readback, small_faces, submission, surfaces, triangles
from benchmarks.probes.probe import Probe, side_px
from benchmarks.report import Judged, bound_lines, make_report
from benchmarks.scenes import load_scenes, usual_scenes
from benchmarks.settings import SETTINGS, at_setting
from benchmarks.suites.limit_figure import limit_figure
from benchmarks.suites.limit_frames import LimitedFrame
from benchmarks.timer import MedianInterval, Timings, time_interleaved
from omnisim.rendering.camera.omnicamera import PAPER_POLYGONS, OmniCamera
from omnisim.rendering.opengl.gl.context import open_context
from omnisim.rendering.stage import Stage

JUDGED = "fast"  # the setting whose numbers have bounds and goals
AFTER_FACES = Limits(
    bound=0.4, goal=0.15, software_only=True,
    reason="the share depends on the processor's rate of texels: 0.18 to 0.25 on an EPYC",
)  # fmt: skip
SAMPLES = Limits(bound=3.7, reason="a count without noise: 3.1 to 3.4 in the usual scenes")
# Processor time of a frame, and of an image in a batch.
FRAME_MS = Limits(
    bound=1.6, goal=0.4,
    reason="0.22 to 0.38 ms on two processors; none in use is four times slower",
)  # fmt: skip
BATCHED_MS = Limits(
    bound=0.12, goal=0.03,
    reason="0.016 to 0.028 ms on two processors; none in use is four times slower",
)  # fmt: skip

figure = limit_figure


def run(options: Options, size_px: int | None = None) -> dict[str, Any]:
    """Probe and render in interleaved rounds.

    Args:
        options: rounds, device and scenes.
        size_px: width of the square image; None: the paper's.

    Raises:
        OmnisimError: no OpenGL, or a scene that cannot be loaded.
    """
    options = options.fewer(2)
    paper = OmniCamera(polygons=PAPER_POLYGONS)
    if size_px is not None:
        paper = paper.resized(size_px)
    context = open_context(options.device)
    with ExitStack() as stack:
        stack.callback(context.release)
        probes = _machine_probes(context)
        frames = []
        for name, scene in load_scenes(options, has_own_light=False).items():
            stage = stack.enter_context(Stage(scene, device=options.device))
            room = stack.enter_context(Stage(surfaces.empty_room(scene), device=options.device))
            probes.append(surfaces.room_probe(name, room))
            probes.append(small_faces.small_faces_probe(name, stage))
            for setting in SETTINGS:
                camera = at_setting(paper, setting)
                frames.append(LimitedFrame.of(context, name, setting, stage, room, camera))
        timings = _time(probes, frames, options)
        of_name = {probe.name: probe for probe in probes}
        rows = [_probe_row(probe, timings) for probe in probes]
        rows += [frame.row(of_name, timings) for frame in frames]
        rows += idle_driver_rows(options.scenes or usual_scenes(), options)
        with context:  # others have been current since
            return make_report(
                "limit", options, context, rows, _judged(rows, is_usual=not options.scenes),
                image_px=paper.model.width_px,
            )  # fmt: skip


def lines(report: dict[str, Any]) -> list[str]:
    """Text of the report: the machine's rates, then the parts of each frame beside their limits."""
    text = [f"{'what the machine can do':44} a second"]
    probes = [row for row in report["rows"] if row["kind"] == "probe"]
    text += [f"{row['name']:44} {_rate(row['per_second'])} {row['unit']}" for row in probes]
    text.append("")
    text.append(
        f"{'a frame, ms':24} {'whole':>7} {'faces':>7} {'(small)':>7}"
        f" {'capture':>8} {'read':>6} {'Python':>7} {'limit':>7}"
        "   share of the limit: whole (95 %), processor, faces, capture, read"
    )
    frames = [row for row in report["rows"] if row["kind"] == "frame"]
    for row in frames:
        text.append(
            f"{row['scene'] + ', ' + row['setting']:24} {row['p50_ms']:7.1f}"
            f" {row['virtual_cameras_ms']:7.1f} {row['small_faces_ms']:7.1f}"
            f" {row['capture_ms']:8.1f} {row['readback_ms']:6.2f} {row['around_ms']:7.2f}"
            f" {row['limit_ms']:7.1f}"
            f"   {row['share_of_limit']:.2f} ({row['share_of_limit_low']:.2f} –"
            f" {row['share_of_limit_high']:.2f}), {row['processor_share_of_limit']:.2f},"
            f" {row['virtual_cameras_share_of_limit']:.2f}, {row['capture_share_of_limit']:.2f},"
            f" {row['readback_share_of_limit']:.2f}"
        )
    text.append("")
    text.append(
        f"{'what is drawn':24} {'texels':>9} {'samples':>9} {'a mirror pixel':>14}"
        f" {'submitted':>10} {'inside':>8} {'seen':>7} {'draws':>6} {'calls':>6} {'ms':>5}"
    )
    for row in frames:
        inside = "?" if row["triangles_inside"] is None else str(row["triangles_inside"])
        text.append(
            f"{row['scene'] + ', ' + row['setting']:24} {row['texels']:9} {row['samples']:9}"
            f" {row['samples_a_mirror_px']:14.2f} {row['triangles']:10} {inside:>8}"
            f" {row['triangles_seen']:7} {row['draws']:6} {row['calls']:6} {row['calls_ms']:5.1f}"
        )
    text.append("")
    text += [_idle_driver_line(row) for row in report["rows"] if row["kind"] == "idle driver"]
    return text + bound_lines(report)


def _idle_driver_line(row: dict[str, Any]) -> str:
    return (
        f"{row['scene']}, {row['setting']}: with a driver that draws nothing {row['frame_ms']:.2f}"
        f" ms a frame of {row['frame_px']}², {row['small_frame_ms']:.2f} of {row['batch_px']}²,"
        f" {row['batched_ms']:.3f} in batches of {row['batch']}"
    )


def _rate(per_second: float) -> str:
    return f"{per_second:10.1f}  " if per_second < 1e5 else f"{per_second / 1e6:10.2f} M"


def _machine_probes(context: moderngl.Context) -> list[Probe]:
    return [
        *fill.fill_probes(context, side_px(context)),
        *triangles.triangle_probes(context),
        *readback.readback_probes(context),
        *submission.submission_probes(context),
    ]


def _time(probes: Sequence[Probe], frames: Sequence[LimitedFrame], options: Options) -> Timings:
    works: dict[str, Callable[[], object]] = {probe.name: probe.work for probe in probes}
    for frame in frames:
        works[frame.name] = frame.frame.render
        works[f"{frame.name}, in parts"] = frame.time_parts
    return time_interleaved(works, options.rounds, options.warm_up, options.progress, "limit")


def _probe_row(probe: Probe, timings: Timings) -> dict[str, Any]:
    seconds = timings.seconds[probe.name]
    rates = Timings({"rate": probe.rates(seconds), "one": np.ones_like(seconds)}, {})
    return {
        "kind": "probe", "name": probe.name, "unit": probe.unit, "amount": probe.amount,
        **rates.ratio("rate", "one").flat("per_second"),
        "p50_ms": timings.percentile_ms(probe.name, 50),
    }  # fmt: skip


def _judged(rows: Sequence[dict[str, Any]], is_usual: bool) -> list[Judged]:
    """Numbers with a bound or a goal.

    Args:
        rows: rows of the report.
        is_usual: the scenes are the suite's own: counts of others have no bound.
    """
    frames = [row for row in rows if row["kind"] == "frame" and row["setting"] == JUDGED]
    idle = [row for row in rows if row["kind"] == "idle driver"]
    judged: list[Judged] = []
    for what, key, limits in (
        (f"the processor's ms per frame of {FRAME_PX}²", "frame_ms", FRAME_MS),
        (
            f"the processor's ms per image of {BATCH_PX}² in a batch of {BATCH}",
            "batched_ms",
            BATCHED_MS,
        ),
    ):
        judged += [(f"{what}: {row['scene']}", row[key], limits) for row in idle]
    for row in frames:
        name = f"share of mirror pass, capture and readback: {row['scene']}, {JUDGED}"
        interval = (row[f"after_faces_share{end}"] for end in ("", "_low", "_high"))
        judged.append((name, MedianInterval(*interval), AFTER_FACES))
    if is_usual:
        name = f"shaded samples per pixel of the mirror: {{}}, {JUDGED}"
        judged += [
            (name.format(row["scene"]), row["samples_a_mirror_px"], SAMPLES) for row in frames
        ]
    return judged
