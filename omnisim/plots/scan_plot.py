"""Plot of a laser scan from above."""

from __future__ import annotations

import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.patches import Polygon

from omnisim.core.short_repr import number_text, point_text
from omnisim.sensors.laser_scanner.laser_scanner import Scan

_POINT, _BEAM, _SCANNER, _GRID = "#c23b3b", "#9db8d6", "#333333", "#e4e4e4"
_MARGIN = 0.06  # share of the larger side
_SCANNER_SIZE = 0.016  # share of the larger side


def scan_figure(scan: Scan) -> Figure:
    """Top view of a scan in the scanner's frame: x, ahead, points up, and y points left, in m.

    Beams with a hit are faint lines that end in a point; beams without a hit are not drawn.
    """
    points_m = scan.points_m[:, :2]
    low = np.min(points_m, axis=0, initial=0.0)
    high = np.max(points_m, axis=0, initial=0.0)
    side_m = max(float((high - low).max()), 1.0)
    size_m = np.maximum(high - low, 0.3 * side_m) + 2.0 * _MARGIN * side_m
    middle = 0.5 * (low + high)

    # remaining width for the axes, and the height of title and labels
    height_in = float(np.clip(6.4 * size_m[0] / size_m[1], 2.0, 9.0)) + 1.1
    figure = Figure(figsize=(7.0, height_in), dpi=120, layout="constrained")
    axes = figure.add_subplot()
    beams, hits = len(scan.ranges_m), int(scan.hit.sum())
    near = int(np.isneginf(scan.ranges_m).sum())
    ahead = scan.world_from_scanner[:3, 0]
    yaw = number_text(np.degrees(np.arctan2(ahead[1], ahead[0])), 4)
    name = str(scan.metadata.get("scene", "")).rpartition("/")[2]
    place = point_text(scan.world_from_scanner[:3, 3], 3)
    title = f"{name + ': ' if name else ''}scan from {place} m at yaw {yaw}°\n"
    title += f"{hits} of {beams} beams at {scan.scanner.resolution_deg:g}° hit something"
    title += f", {near} too near" if near else ""
    axes.set_title(title, fontsize=10, parse_math=False)
    axes.set_xlabel("y, to the left (m)")
    axes.set_ylabel("x, ahead (m)")
    axes.grid(True, color=_GRID, linewidth=0.6)
    axes.set_axisbelow(True)
    axes.set_aspect("equal")
    axes.set_xlim(middle[1] + 0.5 * size_m[1], middle[1] - 0.5 * size_m[1])  # y grows to the left
    axes.set_ylim(middle[0] - 0.5 * size_m[0], middle[0] + 0.5 * size_m[0])

    shown = points_m[:, ::-1]
    lines = np.stack((np.zeros_like(shown), shown), axis=1)
    axes.add_collection(LineCollection(list(lines), colors=_BEAM, linewidths=0.4, alpha=0.5))
    axes.plot(shown[:, 0], shown[:, 1], ".", color=_POINT, markersize=3.0)
    half_m = _SCANNER_SIZE * side_m
    corners = [(0.0, 1.6 * half_m), (half_m, -half_m), (-half_m, -half_m)]
    axes.add_patch(Polygon(corners, closed=True, color=_SCANNER, zorder=3))
    return figure
