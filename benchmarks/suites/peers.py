"""Race: the same frame by other renderers' methods, and the quality of each image.

Frames are 360 × 360 px of the paper's mirror, from poses on a path through each scene, without
baked light, which no peer supports. benchmarks/peers/README.md lists the peers and their
differences from the originals. Speeds are compared at equal quality: a peer is compared with the
fastest of our settings whose image is no worse.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.bounds import Limits
from benchmarks.options import Options
from benchmarks.peers import field
from benchmarks.peers.field import Field
from benchmarks.peers.ours import Omnisim
from benchmarks.peers.path import race_poses
from benchmarks.peers.peer import CAMERA, SENSOR
from benchmarks.peers.pyrender_faces import PyrenderFaces
from benchmarks.peers.quality import TRUTH, measured_db, references
from benchmarks.report import Judged, bound_lines, make_report
from benchmarks.scenes import load_scenes
from benchmarks.settings import at_setting
from benchmarks.suites.peers_figure import peers_figure
from benchmarks.timer import Timings, time_interleaved
from omnisim.rendering.stage import Stage

POSES = 10
# References are slow to render: quality is measured at few poses, at fewer by pyrender.
QUALITY_POSES, PYRENDER_QUALITY_POSES = 5, 3
SLOW = (field.PYRENDER, field.PYRENDER_FLAT)  # timed in rounds of their own with ours
TIMES_FEWER = 5
# Time of each peer, relative to our setting of equal quality. Ratios depend on the processor and on
# the scene: bounds are about half of the least that was measured on an EPYC and a Xeon.
_AT_LEAST = partial(Limits, at_least=True, software_only=True)
RATIOS = {
    field.PYRENDER: _AT_LEAST(5.0, 20.0, reason="about half of the least of two processors, 10.7"),
    field.PAPER: _AT_LEAST(1.0, 2.5, reason="at the same quality its method is never faster"),
    field.GAZEBO: _AT_LEAST(1.3, 4.0, reason="half of the least of two processors, 2.6"),
    field.EMBREE: _AT_LEAST(0.4, 1.5, reason="half of the least of two processors, 0.78"),
}
MARGIN_DB = Limits(
    bound=0.0, at_least=True, reason="images do not depend on the machine: 6.7 to 10.2 dB"
)
TRUTHS = {
    field.PYRENDER: "its own 64 samples",
    field.PYRENDER_FLAT: "64 samples, unlit",
    field.UNLIT: "64 samples, unlit",
}
# Flat images are compared with our unlit ones.
UNLIT_DEFAULT = "omnisim, default, unlit"
# A peer without an image has the quality of one ray per pixel.
AS_GOOD_AS = {field.EMBREE: field.EMBREE_COLOR}
Quality = dict[str, dict[int, float]]  # dB by racer, then by number of the pose

figure = peers_figure


def run(options: Options, poses: int = POSES, quality_poses: int = QUALITY_POSES) -> dict[str, Any]:
    """Race in each scene; `passed` if omnisim is within all bounds.

    Args:
        options: rounds, device and scenes.
        poses: number of poses on each path.
        quality_poses: number of these poses at which quality is measured.

    Raises:
        OmnisimError: no OpenGL, or a scene that cannot be loaded.
    """
    rows: list[dict[str, Any]] = []
    judged: list[Judged] = []
    for name, scene in load_scenes(options, has_own_light=False).items():
        with Stage(scene, device=options.device) as stage:
            path = race_poses(stage, poses)
            with Field(stage, options.device) as racers:
                fast_ones = [peer for peer in racers.peers if peer not in SLOW]
                ours = (*field.LADDER, field.UNLIT)
                slow_ones = [peer for peer in racers.peers if peer in (*ours, *SLOW)]
                groups = [(fast_ones, options), (slow_ones, options.fewer(TIMES_FEWER))]
                timings: dict[str, tuple[Timings, int]] = {}
                for group, fewer in groups:
                    timed = _timings(stage, racers, group, path, fewer, f"peers: {name}")
                    timings |= {one: (timed, fewer.rounds) for one in group if one not in timings}
                quality = _quality(stage, racers, path, quality_poses, options)
                as_good = {peer: _as_good(peer, quality) for peer in racers.peers}
                rows += [
                    {"scene": name, **_row(one, racers, timings, quality, as_good)}
                    for one in field.NAMES
                ]
                judged += _judged(name, timings, quality, as_good)
            report = make_report(
                "peers", options, stage.context, rows, judged,
                image_px=CAMERA.width_px,
                theta_max_deg=float(np.degrees(CAMERA.mirror.theta_max_rad)),
                poses=poses,
            )  # fmt: skip
    return report


def lines(report: dict[str, Any]) -> list[str]:
    """Text of the report: a table per scene, and the bounds."""
    text = []
    for scene in dict.fromkeys(row["scene"] for row in report["rows"]):
        text.append(
            f"{scene}, {report['image_px']}², {report['poses']} poses; times ours that is as good"
        )
        text.append(
            f"  {'':20} {'p50':>9} {'p95':>9} {'p99':>9}   {'× ours (95 %)':22} {'cpu':>6} "
            f"{'PSNR':>6} {'worst':>6} {'texels':>9} {'triangles':>9}  as good"
        )
        for row in report["rows"]:
            if row["scene"] == scene:
                text.append(f"  {row['racer']:20} {_row_text(row)}")
    return text + bound_lines(report)


def _timings(
    stage: Stage,
    racers: Field,
    names: list[str],
    path: NDArray[np.float64],
    options: Options,
    what: str,
) -> Timings:
    def frame(name: str) -> Callable[[], None]:
        """Function that renders a frame, at the next pose in each call."""
        next_pose = itertools.cycle(path)
        render = racers.peers[name].render

        def work() -> None:
            render(next(next_pose))
            with stage.current():  # pyrender leaves no context current
                stage.context.finish()

        return work

    variants = {name: frame(name) for name in names}
    return time_interleaved(variants, options.rounds, options.warm_up, options.progress, what)


def _quality(
    stage: Stage, racers: Field, path: NDArray[np.float64], quality_poses: int, options: Options
) -> Quality:
    """PSNR of each renderer that produces an image."""
    numbers = np.arange(quality_poses) * len(path) // quality_poses
    few = numbers[:: -(-len(numbers) // PYRENDER_QUALITY_POSES)]
    lit = dict(zip(numbers, references(stage, path[numbers]), strict=True))
    unlit = dict(zip(few, references(stage, path[few], unlit=True), strict=True))
    quality: Quality = {}
    images = list(racers.images.items())
    for at in options.progress(range(len(images)), "peers: quality", len(images)):
        name, peer = images[at]
        if name == field.PYRENDER and isinstance(peer, PyrenderFaces):
            against = {number: peer.reference(path[number]) for number in few}
        else:
            against = unlit if TRUTHS.get(name) else lit
        measured = measured_db(peer, path[list(against)], list(against.values()))
        quality[name] = dict(zip(map(int, against), map(float, measured), strict=True))
    with Omnisim(stage, at_setting(SENSOR, "default"), UNLIT_DEFAULT, unlit=True) as ours:
        measured = measured_db(ours, path[few], list(unlit.values()))
        quality[UNLIT_DEFAULT] = dict(zip(map(int, few), map(float, measured), strict=True))
    return quality


def _as_good(name: str, quality: Quality) -> str:
    """Name of our fastest setting whose image is no worse than a peer's; else of our best."""
    if name in field.LADDER or name == field.UNLIT:
        return field.FAST
    if name == field.PYRENDER_FLAT:
        return field.UNLIT
    theirs = quality[AS_GOOD_AS.get(name, name)]
    as_good = (one for one in field.LADDER if _margin_db(quality[one], theirs) >= 0.0)
    return next(as_good, field.DEFAULT)


def _row(
    name: str,
    racers: Field,
    timings: dict[str, tuple[Timings, int]],
    quality: Quality,
    as_good: dict[str, str],
) -> dict[str, Any]:
    if name in racers.missing:
        return {"racer": name, "missing": racers.missing[name]}
    timed, rounds = timings[name]
    ratio_to = as_good[name]
    values = list(quality.get(name, {}).values())
    return {
        "racer": name,
        "missing": None,
        "rounds": rounds,
        **timed.row(name),
        "ratio_to": ratio_to,
        **timed.ratio(name, ratio_to).flat("ratio"),
        **timed.processor_ratio(name, ratio_to).flat("processor_ratio"),
        "psnr_db": float(np.median(values)) if values else None,
        "psnr_worst_db": min(values) if values else None,
        "psnr_against": TRUTHS.get(name, TRUTH) if values else None,
        "psnr_poses": len(values),
        "texels": racers.peers[name].texels,
        "triangles": racers.peers[name].triangles,
    }


def _judged(
    scene: str,
    timings: dict[str, tuple[Timings, int]],
    quality: Quality,
    as_good: dict[str, str],
) -> list[Judged]:
    """Times of the peers, and the quality of the default setting."""
    judged: list[Judged] = [
        (
            f"{scene}: {name} to {as_good[name]}, which is as good",
            timings[name][0].ratio(name, as_good[name]),
            limits,
        )
        for name, limits in RATIOS.items()
        if name in timings
    ]
    ours = {*field.LADDER, field.UNLIT, UNLIT_DEFAULT}
    margins = {
        name: _margin_db(
            quality[UNLIT_DEFAULT if name == field.PYRENDER_FLAT else field.DEFAULT], theirs
        )
        for name, theirs in quality.items()
        if name not in ours
    }
    if margins:
        nearest = min(margins, key=lambda name: margins[name])
        text = f"{scene}: PSNR of {field.DEFAULT} over that of {nearest}, its nearest, in dB"
        judged.append((text, margins[nearest], MARGIN_DB))
    return judged


def _margin_db(ours: dict[int, float], theirs: dict[int, float]) -> float:
    """Difference of the median PSNR, over the poses at which both were measured."""
    both = [number for number in ours if number in theirs]
    return float(
        np.median([ours[number] for number in both]) - np.median([theirs[n] for n in both])
    )


def _row_text(row: dict[str, Any]) -> str:
    if row["missing"] is not None:
        return str(row["missing"])
    times = " ".join(f"{row[f'p{p}_ms']:7.1f}ms" for p in (50, 95, 99))
    ratio = f"{row['ratio']:.2f} ({row['ratio_low']:.2f} – {row['ratio_high']:.2f})"
    quality = [_number(row[key], ".1f") for key in ("psnr_db", "psnr_worst_db")]
    counts = [_number(row[key], "d") for key in ("texels", "triangles")]
    return (
        f"{times}   {ratio:22} {row['processor_ratio']:6.2f} {quality[0]:>6} {quality[1]:>6} "
        f"{counts[0]:>9} {counts[1]:>9}  {row['ratio_to']}"
    )


def _number(value: float | None, format: str) -> str:
    return "–" if value is None else f"{value:{format}}"
