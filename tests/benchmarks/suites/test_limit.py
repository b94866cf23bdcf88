"""The limit's suite, run as little as can be: no times, only counts and what must be there."""

import pytest

from benchmarks.options import Options
from benchmarks.report import check
from benchmarks.settings import SETTINGS
from benchmarks.suites import limit
from omnisim.plots.style import write_plot
from tests.conftest import open_context_or_skip


@pytest.fixture(scope="module")
def report():
    open_context_or_skip().release()
    return limit.run(Options(rounds=1, warm_up=1, scenes=("rings", "compass")), size_px=96)


@pytest.mark.slow
def test_report_has_frames_and_probes(report, tmp_path):
    check(report)
    frames = [row for row in report["rows"] if row["kind"] == "frame"]
    assert [(row["scene"], row["setting"]) for row in frames] == [
        (scene, setting) for scene in ("rings", "compass") for setting in SETTINGS
    ]
    rates = [row["per_second"] for row in report["rows"] if row["kind"] == "probe"]
    assert len(rates) > 15
    assert min(rates) > 0.0
    assert report["machine"]["renderer"]
    shown = "\n".join(limit.lines(report))
    assert all(f"{row['scene']}, {row['setting']}" in shown for row in frames)
    write_plot(tmp_path / "limit.png", limit.figure(report))
    assert (tmp_path / "limit.png").stat().st_size > 0


@pytest.mark.slow
def test_the_parts_and_the_limits_add_up(report):
    for row in report["rows"]:
        if row["kind"] != "frame":
            continue
        after = row["capture_ms"] + row["readback_ms"]
        whole = after + row["virtual_cameras_ms"] + row["around_ms"]
        assert row["after_faces_share"] == pytest.approx(after / whole)
        parts = ("texels", "triangles", "lookups", "readback")
        limits = [row[f"limit_{part}_ms"] for part in parts]
        assert row["limit_ms"] == pytest.approx(sum(limits))
        assert row["share_of_limit"] == pytest.approx(row["limit_ms"] / row["p50_ms"])


@pytest.mark.slow
def test_counts_hold_together(report):
    """They are the same in every run, so that additional draws show."""
    for row in report["rows"]:
        if row["kind"] != "frame":
            continue
        share = row["mirror_px"] / 96**2
        assert 0.7 < share < 0.8  # a circle of 105°, the rim's edges and the camera's own place
        assert row["captured_px"] == row["mirror_px"] * (4 if row["setting"] == "fast" else 9)
        assert 0 < row["triangles_seen"] <= row["triangles"]
        assert row["draws"] > 0
        # at least a texel a pixel, for nothing is magnified
        density = SETTINGS[row["setting"]]["texels_per_pixel"] ** 2
        assert row["texels_a_mirror_px"] > density
        assert row["samples_a_mirror_px"] == row["samples"] / row["mirror_px"]
    values = {bound["name"]: bound["value"] for bound in report["bounds"]}
    frames = [row for row in report["rows"] if row["kind"] == "frame"]
    fast = [row for row in frames if row["setting"] == "fast"]
    idle = [row for row in report["rows"] if row["kind"] == "idle driver"]
    # counts of scenes that are not the suite's own have no bound
    assert len(values) == len(fast) + 2 * len(idle)
    for row in fast:
        name = f"share of mirror pass, capture and readback: {row['scene']}, fast"
        assert values[name] == row["after_faces_share"]
    counted = limit._judged(report["rows"], is_usual=True)[-len(fast) :]
    assert [value for _, value, _ in counted] == [row["samples_a_mirror_px"] for row in fast]


@pytest.mark.slow
def test_the_processors_part_is_of_single_frames_and_of_batches(report):
    """Mesa's drivers have the switch; others draw nevertheless, and have no rows."""
    rows = [row for row in report["rows"] if row["kind"] == "idle driver"]
    if "llvmpipe" in report["machine"]["renderer"]:
        assert [row["scene"] for row in rows] == ["rings", "compass"]
    values = {bound["name"]: bound["value"] for bound in report["bounds"]}
    for row in rows:
        assert 0.0 < row["batched_ms"] <= 2.0 * row["small_frame_ms"]
        batched = f"the processor's ms per image of 84² in a batch of 64: {row['scene']}"
        assert values[batched] == row["batched_ms"]
