"""Claims that stand on several pages, against the one place that knows."""

import json
import re

import numpy as np
import pytest

from omnisim.rendering.camera.omnicamera import DEFAULT_NEAR_M
from omnisim.rendering.camera.quality import QUALITIES
from omnisim.rendering.opengl.gl.buffers import MAX_SLICE_BYTES
from omnisim.runs.physics.convex_pieces import SLAB_M, SMALL_M
from omnisim.runs.physics.simulation import (
    LOST_M,
    OBJECT_REACH_M,
    PATH_REACH_M,
    STEP_S,
    TIPPED_COSINE,
)
from omnisim.scene.formats.gltf.reader import FEATURES
from tests.docs.pages import HOW_TO, README, ROOT, WHY, half_unit, numbers_of, text_of, words_of

ACCURACY, PERFORMANCE = WHY + "accuracy.md", WHY + "performance.md"
BENCHMARKS = "benchmarks/README.md"


# Numbers of a table, `#` in patterns, that other pages repeat: page and pattern that a measurement
# writes, then those that repeat its numbers, or the first of them, in the same order.
MEASURES = {
    "rings": (
        ACCURACY,
        r"exact capture, 360 px: each ring's mean radius against the exact relation \| # px \| ≤ "
        r"# px",
        README, r"rings at every 5° of incidence \| # px \| # px",
    ),
    "a real mirror": (
        ACCURACY,
        r"\| markers, mean distance \| # px \| ≤ 0.1 px \| \| \| markers, largest distance \| # "
        r"px \| ≤ 0.2 px",
        README, r"a real mirror traced by Mitsuba: [^|]+\| # px, # px \| 0.1 px, 0.2 px",
    ),
    "non-central systems": (
        ACCURACY,
        r"markers, mean distance in any system \| # px \| ≤ 0.05 px \| \| \| markers, largest "
        r"distance \| # px \| ≤ 0.15 px",
        README, r"non-central mirrors and windows [^|]+\| # px, # px \| 0.05 px, 0.15 px",
    ),
    "focal length": (
        ACCURACY, r"calibration: error of the focal length \| # % \| ≤ # %",
        README, r"chessboards: error of the focal length \| # % \| # %",
    ),
    "shadows in soccer": (
        ACCURACY, r"soccer, mirror: default quality \| # dB \| ≥ # dB",
        README, r"lamps and shadows by Mitsuba: [^|]+\| # dB, [\d.]+ dB \| at least # dB",
        WHY + "rendering.md", r"inside them come to # dB and",
    ),
    "shadows in courtyard": (
        ACCURACY, r"courtyard, mirror: default quality \| # dB",
        README, r"lamps and shadows by Mitsuba: [^|]+\| [\d.]+ dB, # dB",
        WHY + "rendering.md", r"come to [\d.]+ dB and # dB",
    ),
    "materials": (
        ACCURACY,
        r"a lamp: mean CIEDE2000 \| # \| ≤ 2 \| \| \| even light: mean CIEDE2000 \| # \| ≤ 2 \| "
        r"\| \| an environment map: mean CIEDE2000 \| # \|",
        WHY + "rendering.md", r"are # under a lamp, # under even light and # under an env",
    ),
    "baked soccer": (
        ACCURACY,
        r"soccer, mirror: baked \| # dB .*?similarity \| # .*?soccer, fisheye: baked \| # dB "
        r".*?similarity \| # ",
        WHY + "baked-light.md", r"\| `soccer` \| # dB, # \| # dB, # \|",
    ),
    "baked courtyard": (
        ACCURACY,
        r"courtyard, mirror: baked \| # dB .*?similarity \| # .*?courtyard, fisheye: baked \| # "
        r"dB .*?similarity \| # ",
        WHY + "baked-light.md", r"\| `courtyard` \| # dB, # \| # dB, # \|",
    ),
    "two back ends": (
        ACCURACY, r"worst image \| [\d.]+ dB \| ≥ # dB",
        WHY + "back-ends.md", r"agree to # dB or more",
        HOW_TO + "choose.md", r"agree to \[# dB or more\]",
    ),
    "a mesh of 1024 polygons": (
        WHY + "optics.md", r"\| 1024 \| [\d.]+ px \| [\d.]+ px \| # px \|",
        "omnisim/ground_truth/README.md", r"`-n 1024` it is within # px at 360 × 360",
    ),
    "the paper's real run": (
        WHY + "self-localization.md",
        r"real setting \| step at which the gate opens, median \| # \| ≥ 6 .*? gate opens, median "
        r"\| # m",
        WHY + "paper.md", r"hand-picked landmarks: step #, # m",
    ),
    "times of the back ends": (
        WHY + "back-ends.md", r"in the same process takes # s and # s",
        HOW_TO + "choose.md", r"0.1 s \| .*?\| # s \| The two",
    ),
    "chessboards": (
        ACCURACY,
        r"aligned, cv2.omnidir: reprojection, RMS \| # px .*? with distortion, RMS \| # px",
        WHY + "non-central-optics.md",
        r"against # px for the aligned mirror\. With distortion it leaves # px",
    ),
    "a mesh measured": (
        ACCURACY,
        r"1024 polygons, mean error \| # px \| ≤ [\d.]+ px \| \| \| 1024 polygons, largest error "
        r"\| # px",
        WHY + "optics.md", r"\| 1024 \| # px \| [\d.]+ px \| # px \|",
    ),
    "polygons of the paper": (
        WHY + "optics.md", r"\| 1024 \| # px \| [\d.]+ px \| # px \|",
        HOW_TO + "choose.md", r"paper's mesh: # px off on average at 360 × 360 px, # px at",
    ),
}  # fmt: skip


@pytest.mark.parametrize("claim", MEASURES)
def test_repeated_numbers_are_those_of_their_source(claim):
    source, measured, *places = MEASURES[claim]
    known = numbers_of(source, measured)
    for page, pattern in zip(places[::2], places[1::2], strict=True):
        stated = numbers_of(page, pattern)
        for one, true in zip(stated, known[: len(stated)], strict=True):
            distance = abs(float(one) - float(true))
            assert distance <= half_unit(one) + 1e-9, f"{page}: {one}, {source}: {true}"


def _row(name, pattern):
    """Numbers of a row of the table of other renderers."""
    row = re.search(rf"^\| {re.escape(name)} \|.*$", text_of(PERFORMANCE), re.MULTILINE)
    assert row, f"{PERFORMANCE}: {name}: not there"
    return [float(value) for value in re.findall(pattern, row[0])]


@pytest.mark.parametrize(
    ("page", "pattern", "rows", "number"),
    [
        (README, r"pyrender with five[^|]+\| # to # ×", ("pyrender",), r"([\d.]+) × ours"),
        (README, r"the paper's method[^|]+\| # to # ×", ("the paper's way",), r"([\d.]+) × ours"),
        (README, r"Gazebo's method \| # to # ×", ("Gazebo's way",), r"([\d.]+) × ours"),
        (README, r"at fast quality \| # to # ms", ("omnisim, fast",), r"([\d.]+) ms"),
        (README, r"at default quality \| # to # ms", ("omnisim, default",), r"([\d.]+) ms"),
        (HOW_TO + "choose.md", r"2 × 2 \| # to # ms", ("omnisim, fast",), r"([\d.]+) ms"),
        (HOW_TO + "choose.md", r"3 × 3 \| # to # ms", ("omnisim, default",), r"([\d.]+) ms"),
        (HOW_TO + "choose.md", r"2 × 2 [^d]+\| # to # dB", ("omnisim, fast",), r"([\d.]+) dB"),
        (HOW_TO + "choose.md", r"3 × 3 [^d]+\| # to # dB", ("omnisim, default",), r"([\d.]+) dB"),
        (
            WHY + "objects.md",
            r"\[# to # ms\]",
            ("omnisim, fast", "omnisim, default"),
            r"([\d.]+) ms",
        ),
    ],
)
def test_repeated_ranges_are_those_of_the_benchmark(page, pattern, rows, number):
    values = [value for row in rows for value in _row(row, number)]
    assert len(values) == 3 * len(rows)
    for stated, true in zip(numbers_of(page, pattern), (min(values), max(values)), strict=True):
        # within a unit: half a unit for the range's own rounding, half for a bound rounded inwards
        assert abs(float(stated) - true) <= 2 * half_unit(stated), (
            f"{page}: {stated}, measured {true}"
        )


@pytest.mark.parametrize(
    ("pattern", "measured"),
    [
        (r"FPS\(4096\)/FPS\(16\) is # to #", r"FPS\(16\), [^|]+\| ([\d.]+) \("),
        (r"# to # times as much at `fast`", r", fast: beside [^:]+: ([\d.]+) times"),
        (r"# to # times at default", r", default: beside [^:]+: ([\d.]+) times"),
        (r"a scan costs # to # ms", r"the LMS200 ([\d.]+) ms"),
    ],
)
def test_the_comparison_with_the_paper_is_that_of_the_benchmark(pattern, measured):
    values = [float(value) for value in re.findall(measured, words_of(BENCHMARKS))]
    for page in (WHY + "paper.md", PERFORMANCE):
        stated = numbers_of(page, pattern)
        for one, true in zip(stated, (min(values), max(values)), strict=True):
            assert abs(float(one) - true) <= half_unit(one), f"{page}: {one}, measured {true}"


def _result(suite, **row):
    """First row of a suite's committed results with these values."""
    text = (ROOT / f"benchmarks/results/llvmpipe-2-cores/{suite}.json").read_text(encoding="utf-8")
    return next(load for load in json.loads(text)["rows"] if row.items() <= load.items())


def test_numbers_of_batches_are_those_of_the_benchmark():
    batch = _result("scaling", against="batch", image_px=84, cameras=64)
    idle = _result("limit", kind="idle driver", scene="soccer", setting="fast")
    ratio, processor = batch["batch_ratio"], batch["batch_processor_ratio"]
    times_ms = (idle["small_frame_ms"], idle["batched_ms"])
    for page, pattern, values in (
        (PERFORMANCE, r"takes # of a single frame's time, and # of its", (ratio, processor)),
        (PERFORMANCE, r"falls from # to # ms per image", times_ms),
        (BENCHMARKS, r"of 84² takes # of the time of single frames", (ratio,)),
        (BENCHMARKS, r"processor's # ms per image # are left", times_ms),
    ):
        for stated, true in zip(numbers_of(page, pattern), values, strict=True):
            assert abs(float(stated) - true) <= half_unit(stated), f"{page}: {stated}, {true}"


def test_numbers_of_the_code():
    samples = {name: quality.supersampling for name, quality in QUALITIES.items()}
    for name, count in samples.items():
        assert f"`{name}` | {count} × {count}" in words_of(HOW_TO + "choose.md")
    stated = numbers_of(
        WHY + "rendering.md", r"`fast` takes # × \d samples, `default` # × \d, `fine` # × \d"
    )
    assert [int(one) for one in stated] == [samples[name] for name in ("fast", "default", "fine")]
    near = numbers_of(WHY + "assumptions.md", r"than their near plane, # m")
    assert float(near[0]) == DEFAULT_NEAR_M
    assert numbers_of(HOW_TO + "troubleshooting.md", r"near plane, # m") == near
    mebibytes = str(MAX_SLICE_BYTES >> 20)
    for page in (HOW_TO + "batches.md", PERFORMANCE, HOW_TO + "troubleshooting.md"):
        assert f"{mebibytes} MiB" in words_of(page), page


def test_numbers_of_physics():
    page = WHY + "physics.md"
    for pattern, value in (
        (r"at # steps per second", 1.0 / STEP_S),
        (r"fits into # m", SMALL_M),
        (r"a slab of # cm", 100.0 * SLAB_M),
        (r"farther than # m from the path", PATH_REACH_M),
        (r"beyond # m from them", OBJECT_REACH_M),
        (r"leaves the path by # m", LOST_M),
    ):
        assert float(numbers_of(page, pattern)[0]) == pytest.approx(value), pattern
    tilt_deg = float(numbers_of(page, r"tilts by #°")[0])
    assert np.cos(np.radians(tilt_deg)) == pytest.approx(TIPPED_COSINE, abs=0.01)


def test_what_gltf_materials_lack_is_said():
    (transmission,) = [feature for feature in FEATURES if "glass is opaque" in feature.effect]
    assert transmission.name == "transmissionTexture"


# Sentences that several pages have, whole: one that changes on one page changes on all.
STATEMENTS = {
    "even light": (
        "has even light: ambient light and two directional lights, without shadows",
        HOW_TO + "light.md", WHY + "rendering.md", WHY + "assumptions.md",
    ),
    "even light, short": (
        "even light, without shadows",
        README, HOW_TO + "own-scene.md",
    ),
    "reflections": (
        "are approximate; `--backend rays` traces them",
        README, WHY + "assumptions.md",
    ),
    "transmission": (
        "Clear glass transmits; other glass is opaque unless it is alpha-blended",
        README, WHY + "assumptions.md",
    ),
    "emission": (
        "Emissive surfaces light others only in [baked light](baked-light.md)",
        WHY + "rendering.md", WHY + "assumptions.md",
    ),
    "holes and glass": (
        "Rays pass through holes of masked surfaces, and through blended surfaces with an alpha "
        "below 0.5",
        HOW_TO + "ground-truth.md", WHY + "sensors.md", "omnisim/ground_truth/README.md",
    ),
    "sky in rooms": (
        "Without baked light nothing occludes the sky",
        WHY + "rendering.md", WHY + "assumptions.md",
    ),
    "no caustics": (
        "there are no caustics",
        HOW_TO + "light.md", WHY + "baked-light.md",
    ),
    "physics": (
        "by 0.5 m or tilts by 45°",
        HOW_TO + "drives.md", WHY + "physics.md",
    ),
}  # fmt: skip


@pytest.mark.parametrize("claim", STATEMENTS)
def test_pages_say_the_same(claim):
    sentence, *pages = STATEMENTS[claim]
    for page in pages:
        assert sentence in words_of(page), f"{page}: {sentence}: not there"
