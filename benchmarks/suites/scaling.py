"""Cost of a frame by triangles of the scene, pixels of the image, and number of cameras.

All frames are at the fast setting, with exact rays. The growing scene is a town of equally detailed
houses, seen from a street. There, Embree casts the same image's rays on one thread, and is compared
with the fastest of our settings whose image is no worse than one ray per pixel. Images and cameras
are measured in one scene: `soccer`, or the first requested scene. Batches of small images are
compared there with the same images rendered one after the other.
"""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.bounds import Limits
from benchmarks.embree_rays import EmbreeRays, has_embree
from benchmarks.options import Options
from benchmarks.patrol import ROBOT, patrol
from benchmarks.peers.embree import EmbreeColors
from benchmarks.peers.field import LADDER, rung
from benchmarks.peers.ours import Omnisim
from benchmarks.peers.quality import measured_db, references
from benchmarks.pipeline_parts import RepeatedFrame
from benchmarks.report import Judged, bound_lines, make_report
from benchmarks.seen_triangles import count_seen_triangles
from benchmarks.settings import at_setting
from benchmarks.suites.scaling_figure import scaling_figure
from benchmarks.timer import MedianInterval, Timings, time_interleaved
from benchmarks.town import build_town
from omnisim.core.poses import pose
from omnisim.rendering.camera.omnicamera import OmniCamera
from omnisim.rendering.renderer import Renderer
from omnisim.rendering.stage import Stage
from omnisim.robots.vehicle import Vehicle
from omnisim.scene import load_scene

SETTING, SIZE_PX, SCENE = "fast", 360, "soccer"
# Triangles of the towns, approximately, and the most that a frame may submit.
TRIANGLES = {
    1_000: 1_100, 10_000: 11_500, 100_000: 14_500, 1_000_000: 38_500, 5_000_000: 77_000
}  # fmt: skip
SUBMITTED_REASON = "a count without noise, and a tenth for other drivers' depth"
# Submitted triangles relative to seen ones, by triangles of the town.
SUBMITTED_GOALS = {100_000: Limits(goal=8.0), 1_000_000: Limits(goal=18.0)}
SIZES_PX = (128, 256, 512, 1024, 2048)
CAMERAS = (1, 2, 4, 8, 16, 32, 64)
BATCHES, BATCH_PX = (1, 2, 4, 8, 16, 32, 64, 128, 256), 84  # images, and their side
# A batch relative to the same images one after the other, by number of images. Bounds are of
# processor time, which other programs hardly change.
BATCH_GOALS = {64: Limits(goal=0.6)}
BATCH_BOUNDS = {
    1: Limits(bound=1.25, software_only=True, reason="the same work as one image: 1.02 to 1.05"),
    64: Limits(
        bound=1.1, reason="0.76 on an EPYC, 0.92 to 0.96 on Xeons: never more work than its images"
    ),
}
LARGE = 1_000_000  # triangles of the largest town that is judged against Embree
EMBREE_RATIO = Limits(
    bound=0.2, goal=1.0, at_least=True, software_only=True,
    reason="rays are no OpenGL, so that the ratio depends on the processor; half of the least of "
    "two, 0.46",
)  # fmt: skip
OURS, AS_GOOD, EMBREE = "omnisim", "omnisim, as good as a ray a pixel", "embree"
POSES = 6
# Headings along the street, across it, and in between, so that none is special.
STREET = tuple(
    pose((2.0 + 1.8 * step, 0.4 * (step - 2), 1.2), yaw_deg=17.0 * step) for step in range(POSES)
)
Take = Callable[[NDArray[np.float64]], object]

figure = scaling_figure


def run(
    options: Options,
    triangles: Sequence[int] = tuple(TRIANGLES),
    sizes_px: Sequence[int] = SIZES_PX,
    cameras: Sequence[int] = CAMERAS,
    batches: Sequence[int] = BATCHES,
) -> dict[str, Any]:
    """Time frames as triangles, image size, cameras and batches grow.

    Args:
        options: rounds, device and scenes.
        triangles: approximate numbers of triangles of the towns.
        sizes_px: widths of the square images.
        cameras: numbers of cameras.
        batches: numbers of small images per batch.

    Raises:
        OmnisimError: no OpenGL, or a scene that cannot be loaded or driven through.
    """
    towns = [_of_town(count, _town_options(options, count)) for count in triangles]
    rows = [row for row, _ in towns]
    judged: list[Judged] = [
        (f"Embree's rays to a frame, {row['triangles']} triangles", interval, EMBREE_RATIO)
        for count, (row, interval) in zip(triangles, towns, strict=True)
        if interval is not None and count <= LARGE
    ]
    judged += [
        (
            f"submitted triangles, of {row['triangles']}",
            row["submitted_triangles"],
            Limits(bound=TRIANGLES[count], reason=SUBMITTED_REASON),
        )
        for count, row in zip(triangles, rows, strict=True)
        if count in TRIANGLES
    ]
    judged += [
        (
            f"submitted to seen triangles, of {row['triangles']}",
            row["submitted_triangles"] / row["seen_triangles"],
            SUBMITTED_GOALS[count],
        )
        for count, row in zip(triangles, rows, strict=True)
        if count in SUBMITTED_GOALS
    ]
    scene, vehicle = load_scene(options.scenes[0] if options.scenes else SCENE), Vehicle.load(ROBOT)
    base_from_eye = vehicle.camera().sensor.base_from_rig
    with Stage(scene, device=options.device) as stage:
        along = patrol(scene, vehicle, POSES) @ base_from_eye
        rows += _of_sizes(stage, along, sizes_px, options.fewer(3))
        rows += _of_cameras(stage, along, cameras, _slowest(options))
        for row, ratio, processor_ratio in _of_batches(stage, along, batches, _slowest(options)):
            rows.append(row)
            count = row["cameras"]
            name = f"a batch of {count} images of {BATCH_PX}² to single images"
            if count in BATCH_GOALS:
                judged.append((name, ratio, BATCH_GOALS[count]))
            if count in BATCH_BOUNDS:
                judged.append((f"{name}, processor time", processor_ratio, BATCH_BOUNDS[count]))
        with stage.current():
            return make_report(
                "scaling", options, stage.context, rows, judged,
                scene=scene.name, setting=SETTING, has_embree=has_embree(),
            )  # fmt: skip


def lines(report: dict[str, Any]) -> list[str]:
    """Text of the report, one line per row."""
    text = [f"{report['setting']}, {SIZE_PX}² where nothing else is said; {report['scene']}"]
    for row in report["rows"]:
        times = " ".join(f"{row[f'p{p}_ms']:8.1f}ms" for p in (50, 95, 99))
        line = f"{_title(row):>17} {times} {row['fps']:8.2f} FPS {row['rounds']:4} rounds"
        if row["against"] == "triangles":
            line += f"   {row['submitted_triangles']} submitted, {row['seen_triangles']} seen"
        if row["against"] == "cameras":
            line += f"   {row['ms_a_camera']:.1f} ms a camera"
        if row["against"] == "batch":
            line += (
                f"   {row['images_per_second']:.0f} images/s batched, "
                f"{row['single_images_per_second']:.0f} one after the other: "
                f"{row['batch_ratio']:.2f} × "
                f"({row['batch_ratio_low']:.2f} – {row['batch_ratio_high']:.2f}), "
                f"processor {row['batch_processor_ratio']:.2f} ×"
            )
        if "embree_ratio" in row:
            line += (
                f"   Embree {row['embree_p50_ms']:.1f} ms: {row['embree_ratio']:.2f} × "
                f"({row['embree_ratio_low']:.2f} – {row['embree_ratio_high']:.2f}) {row['as_good']}"
            )
        text.append(line)
    if not report["has_embree"]:
        text.append("embreex is not installed: no comparison, and nothing is asked for")
    return text + bound_lines(report)


def _of_town(triangles: int, options: Options) -> tuple[dict[str, Any], MedianInterval | None]:
    """Row of a town, and the ratio of Embree's time to ours; None without Embree."""
    scene, sensor = build_town(triangles), _sensor(SIZE_PX)
    with ExitStack() as opened:
        stage = opened.enter_context(Stage(scene, device=options.device))
        renderer = opened.enter_context(stage.open(sensor))
        variants = {OURS: _frame(stage, [(renderer.render, STREET)])}
        if has_embree():
            rays = EmbreeRays(scene, sensor.model)
            quality = _as_good_as_rays(stage)
            as_good = opened.enter_context(stage.open(rung(quality["as_good"])))
            variants[AS_GOOD] = _frame(stage, [(as_good.render, STREET)])
            variants[EMBREE] = _frame(stage, [(rays.cast, STREET)])
        timings = _time(variants, options, f"{scene.triangle_count} triangles")
        row = _row("triangles", stage, timings, OURS) | _counts(stage, renderer)
    if EMBREE not in variants:
        return row, None
    ratio = timings.ratio(EMBREE, AS_GOOD)
    row.update(quality)
    row["as_good_p50_ms"] = timings.percentile_ms(AS_GOOD, 50)
    row["embree_p50_ms"] = timings.percentile_ms(EMBREE, 50)
    row.update(ratio.flat("embree_ratio"))
    return row, ratio


def _as_good_as_rays(stage: Stage) -> dict[str, Any]:
    """Our fastest setting that is no worse than one ray per pixel, and the PSNR of both."""
    eyes = np.stack(STREET[:1])
    truth = references(stage, eyes)
    of_rays = float(measured_db(EmbreeColors(stage.scene), eyes, truth)[0])
    for name in LADDER:
        with Omnisim(stage, rung(name), name) as ours:
            of_ours = float(measured_db(ours, eyes, truth)[0])
        if of_ours >= of_rays:
            break
    return {"as_good": name, "as_good_psnr_db": of_ours, "embree_psnr_db": of_rays}


def _counts(stage: Stage, renderer: Renderer) -> dict[str, int]:
    """Number of triangles submitted by the virtual cameras, and shown by the frame."""
    sensor, eye = renderer.camera, STREET[0]
    submitted = RepeatedFrame(renderer, eye).count().virtual_cameras.triangles
    seen = count_seen_triangles(
        stage.context, stage.scene, sensor.model, eye, SIZE_PX, sensor.near_m
    )
    return {"submitted_triangles": submitted, "seen_triangles": seen}


def _of_sizes(
    stage: Stage, eyes: NDArray[np.float64], sizes_px: Sequence[int], options: Options
) -> list[dict[str, Any]]:
    with ExitStack() as renderers:
        variants = {}
        for size_px in sizes_px:
            renderer = renderers.enter_context(stage.open(_sensor(size_px)))
            variants[str(size_px)] = _frame(stage, [(renderer.render, eyes)])
        timings = _time(variants, options, "size of the image")
    return [_row("image", stage, timings, str(size_px), image_px=size_px) for size_px in sizes_px]


def _of_cameras(
    stage: Stage, eyes: NDArray[np.float64], cameras: Sequence[int], options: Options
) -> list[dict[str, Any]]:
    """Rows for several cameras of one stage; a frame has one image of each camera."""
    with ExitStack() as renderers:
        sensors = [
            (
                renderers.enter_context(stage.open(_sensor(SIZE_PX))).render,
                np.roll(eyes, -camera, axis=0),
            )
            for camera in range(max(cameras))
        ]
        variants = {str(count): _frame(stage, sensors[:count]) for count in cameras}
        timings = _time(variants, options, "number of cameras")
    rows = [_row("cameras", stage, timings, str(count), cameras=count) for count in cameras]
    return [{**row, "ms_a_camera": row["p50_ms"] / row["cameras"]} for row in rows]


def _of_batches(
    stage: Stage, eyes: NDArray[np.float64], batches: Sequence[int], options: Options
) -> Iterator[tuple[dict[str, Any], MedianInterval, MedianInterval]]:
    """Rows for small images in batches, with time and processor time relative to single images.

    Each size has its own renderer: a renderer allocates its atlas anew when the size changes.
    """
    with ExitStack() as renderers:
        single = renderers.enter_context(stage.open(_sensor(BATCH_PX)))
        variants: dict[str, Callable[[], None]] = {}
        for count in batches:
            poses = np.resize(eyes, (count, 4, 4))
            batched = renderers.enter_context(stage.open(_sensor(BATCH_PX)))
            variants[f"{count} batched"] = _frame(stage, [(batched.render_batch, [poses])])
            variants[f"{count} single"] = _frame(stage, [(single.render, [pose]) for pose in poses])
        timings = _time(variants, options, "images in a batch")
    for count in batches:
        together, one_by_one = f"{count} batched", f"{count} single"
        ratio = timings.ratio(together, one_by_one)
        processor_ratio = timings.processor_ratio(together, one_by_one)
        row = {
            **_row("batch", stage, timings, together, BATCH_PX, count),
            "images_per_second": count * timings.frames_per_second(together).median,
            "single_images_per_second": count * timings.frames_per_second(one_by_one).median,
            **ratio.flat("batch_ratio"),
            **processor_ratio.flat("batch_processor_ratio"),
        }
        yield row, ratio, processor_ratio


def _sensor(size_px: int) -> OmniCamera:
    return at_setting(OmniCamera(polygons=None).resized(size_px), SETTING)


def _frame(
    stage: Stage, sensors: Sequence[tuple[Take, Iterable[NDArray[np.float64]]]]
) -> Callable[[], None]:
    """Function that takes a measurement of each sensor, at its next pose in each call."""
    cycles = [(take, itertools.cycle(poses)) for take, poses in sensors]

    def work() -> None:
        for take, poses in cycles:
            take(next(poses))
        with stage.current():
            stage.context.finish()

    return work


def _town_options(options: Options, triangles: int) -> Options:
    """Options with fewer rounds for large towns."""
    if triangles > LARGE:
        return _slowest(options)
    return options.fewer(3) if triangles == LARGE else options


def _slowest(options: Options) -> Options:
    """Options with the fewest rounds, for frames that take seconds."""
    return dataclasses.replace(options.fewer(5), warm_up=min(options.warm_up, 1))


def _time(variants: dict[str, Callable[[], None]], options: Options, what: str) -> Timings:
    return time_interleaved(
        variants, options.rounds, options.warm_up, options.progress, f"scaling: {what}"
    )


def _row(
    against: str, stage: Stage, timings: Timings, variant: str, image_px: int = SIZE_PX,
    cameras: int = 1,
) -> dict[str, Any]:  # fmt: skip
    return {
        "against": against,
        "triangles": stage.scene.triangle_count,
        "image_px": image_px,
        "cameras": cameras,
        **timings.row(variant),
        "rounds": len(timings.seconds[variant]),
    }


def _title(row: dict[str, Any]) -> str:
    """Description of a row."""
    if row["against"] == "triangles":
        return f"{row['triangles']} triangles"
    if row["against"] == "image":
        return f"{row['image_px']}²"
    if row["against"] == "batch":
        return f"{row['cameras']} of {row['image_px']}²"
    return "1 camera" if row["cameras"] == 1 else f"{row['cameras']} cameras"
