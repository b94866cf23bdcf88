"""The plot of a scan: what is in it, and its file."""

import numpy as np
import pytest
from matplotlib.collections import LineCollection
from matplotlib.patches import Polygon

from omnisim import LaserScanner, Scan
from omnisim.core.errors import OutputError
from omnisim.core.poses import pose
from omnisim.plots.scan_plot import scan_figure
from omnisim.plots.style import check_plot_target, write_plot


def scan_with(ranges_m):
    scanner = LaserScanner.lms200(1.0)
    angles = np.radians(scanner.angles_deg)
    at = pose((1.0, 2.0, 0.5), yaw_deg=30.0)
    return Scan(angles, ranges_m, scanner, at, {"scene": "/somewhere/h$\\all$.glb"})


def mixed():
    ranges = np.linspace(2.0, 6.0, 181)
    ranges[:50] = np.inf
    ranges[50:53] = -np.inf
    return scan_with(ranges)


def test_only_beams_that_hit_are_drawn():
    figure = scan_figure(mixed())
    (axes,) = figure.axes
    (points,) = axes.lines
    (beams,) = [item for item in axes.collections if isinstance(item, LineCollection)]
    expected = mixed().points_m
    assert len(expected) == 128
    np.testing.assert_array_equal(points.get_xydata(), expected[:, 1::-1])
    assert len(beams.get_segments()) == 128
    assert np.all(np.array(beams.get_segments())[:, 0] == 0.0)
    assert any(isinstance(patch, Polygon) for patch in axes.patches)
    assert axes.get_legend() is None
    assert axes.get_title() == (
        "h$\\all$.glb: scan from (1, 2, 0.5) m at yaw 30°\n128 of 181 beams at 1° hit something, "
        "3 too near"
    )


def test_axes_are_equal_and_left_is_left():
    axes = scan_figure(mixed()).axes[0]
    assert axes.get_aspect() == 1.0
    left, right = axes.get_xlim()
    assert left > right  # y grows to the left
    low, high = axes.get_ylim()
    x, y = mixed().points_m[:, :2].T
    assert right < y.min() < y.max() < left
    assert low < min(0.0, x.min()) < x.max() < high


@pytest.mark.parametrize("range_m", [np.inf, -np.inf, 0.2])
def test_scans_without_extent_have_a_plot_too(range_m, tmp_path):
    write_plot(tmp_path / "a.png", scan_figure(scan_with(np.full(181, range_m))))
    assert (tmp_path / "a.png").stat().st_size > 1000


@pytest.mark.parametrize(
    ("name", "first"), [("a.png", b"\x89PNG"), ("a.pdf", b"%PDF"), ("a.SVG", b"<?xml")]
)
def test_formats(name, first, tmp_path):
    path = tmp_path / name
    check_plot_target(path)
    write_plot(path, scan_figure(mixed()))
    assert path.read_bytes().startswith(first)
    assert [file.name for file in tmp_path.iterdir()] == [name]


def test_unwritable_files_are_refused_early(tmp_path):
    with pytest.raises(OutputError, match=r"a\.gif: expected \.png, \.pdf, \.svg, got \.gif"):
        check_plot_target(tmp_path / "a.gif")
    (tmp_path / "file").touch()
    with pytest.raises(OutputError, match="file: is a file: expected a folder"):
        check_plot_target(tmp_path / "file" / "a.png")
