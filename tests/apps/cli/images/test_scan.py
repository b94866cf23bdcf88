"""`omnisim scan`: output, files and errors."""

import json

import numpy as np
import pytest
import trimesh

pytestmark = pytest.mark.usefixtures("needs_opengl")


def ranges_of(path):
    return np.loadtxt(path, delimiter=",", comments=("#", "beam"))


def test_scan_writes_ranges_and_a_summary(quiet, tmp_path):
    out = quiet("scan", "courtyard", "-o", "a.csv", "--at", 2, 1, 0.3)
    table = ranges_of(tmp_path / "a.csv")
    assert table.shape == (361, 3)
    count = int(np.isfinite(table[:, 2]).sum())
    assert 100 < count < 361
    assert out == (
        f"a.csv: 361 beams at 0.5° from (2, 1, 0.3) m at yaw 0°: {count} ranges, "
        f"{361 - count} past 8.19 m, 0 under 0.1 m\n"
    )


def test_scan_with_all_options(quiet, tmp_path):
    out = quiet(
        "scan", "compass", "-o", "a.csv", "--plot", "a.png", "--yaw", 90, "--resolution", 1,
        "--mode", "cm", "--no-noise", "--seed", 4, "--up", "y", "--at", 0, 0, 1,
    )  # fmt: skip
    assert "a.png: the scan from above" in out
    assert (tmp_path / "a.png").stat().st_size > 10_000
    _, angles_deg, ranges_m = ranges_of(tmp_path / "a.csv").T
    angles = np.radians(angles_deg)
    # the room is 6 m × 6 m: exact ranges, rounded to 1 cm
    expected = 3.0 / np.maximum(np.abs(np.cos(angles)), np.abs(np.sin(angles)))
    assert np.abs(ranges_m - expected).max() <= 0.005 + 1e-6
    assert "# seed: 4" in (tmp_path / "a.csv").read_text()


def test_a_scanner_that_is_tilted_sees_the_floor_ahead(quiet, tmp_path):
    out = quiet(
        "scan", "compass", "-o", "a.csv", "--no-noise", "--mode", "cm", "--at", 0, 0, 1,
        "--pitch", 60, "--resolution", 1,
    )  # fmt: skip
    assert "at yaw 0°, pitch 60°" in out
    _, angles_deg, ranges_m = ranges_of(tmp_path / "a.csv").T
    (ahead_m,) = ranges_m[angles_deg == 0.0]
    assert ahead_m == pytest.approx(1.0 / np.sin(np.radians(60.0)), abs=0.006)  # steps of 1 cm


def test_a_seed_is_a_device(quiet, tmp_path):
    for name, seed in (("a.csv", 1), ("b.csv", 1), ("c.csv", 2)):
        quiet("scan", "compass", "-o", name, "--seed", seed)
    first, again, other = ((tmp_path / name).read_bytes() for name in ("a.csv", "b.csv", "c.csv"))
    assert first == again != other


def test_the_unit_of_a_scene_file_is_an_option_of_all_commands_that_take_a_scene(
    ran, quiet, tmp_path
):
    """A room of 4 m × 4 m × 3 m, in millimeters; ranges and a run say so."""
    trimesh.creation.box(extents=(4000.0, 4000.0, 3000.0)).export(tmp_path / "room.stl")
    room = ["room.stl", "--meters-per-unit", "0.001"]
    ran("scan", *room, "-o", "a.csv", "--no-noise", "--at", 0, 0, 0.5)
    assert np.nanmin(ranges_of(tmp_path / "a.csv")[:, 2]) == pytest.approx(2.0, abs=1e-3)
    ran("render", *room, "-o", "a.exr", "--size", 32, "--at", 0, 0, 0, "--also", "range")
    (tmp_path / "path.csv").write_text("x_m,y_m\n-1,0\n1,0\n")
    drive = ["drive", *room, "--robot", "superscout", "--path", "path.csv", "--size", "16"]
    ran(*drive, "--step", "2", "-o", "run")
    manifest = json.loads((tmp_path / "run" / "manifest.json").read_text())
    assert manifest["scene"]["meters_per_unit"] == 0.001
    quiet("plot", "run")  # no note that the scene has changed
