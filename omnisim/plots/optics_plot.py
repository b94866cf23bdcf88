"""Plot of an optical system: its profile with rays, its caustic, and its resolution."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Polygon

from omnisim.cameras.optics import OpticalSystem, Surface, caustic_points, ray_jacobians
from omnisim.cameras.optics.surface import Fate
from omnisim.core.arrays import Floats
from omnisim.plots.style import BLUE, DPI, GRAY, GREEN, ORANGE, label_axes, show_between

_RAYS = 25  # number of drawn rays
_COLUMNS = 400  # of the image, for caustic and resolution
_MARGIN = 0.15  # share of the drawn part's size
_SHOWN_PERCENT = (4.0, 96.0)  # percentiles of the caustic, which may extend to infinity
_MIN_M = 2e-4  # minimum size of the drawn part of the caustic


def optics_figure(name: str, system: OpticalSystem) -> Figure:
    """Figure of a system: section with rays, enlarged caustic, and angular resolution.

    All three are for the image row of the principal point; the resolution is in degrees per pixel,
    by the radius in the image.
    """
    figure = Figure(figsize=(14.0, 5.2), dpi=DPI, layout="constrained")
    section, near, resolution = figure.subplots(1, 3, width_ratios=(1.0, 0.8, 1.0))
    caustic_m = caustic_points(system, _row(system, _COLUMNS)) + system.origin_m
    label_axes(section, f"{name}: rays", "x (mm)", "z (mm)")
    low, high = _draw_section(section, system, caustic_m)
    _frame(section, low, high)
    label_axes(near, "Caustic: where neighboring rays meet", "x (mm)", "z (mm)")
    _draw_section(near, system, caustic_m)
    seen = caustic_m.reshape(-1, 3)[:, [0, 2]]
    if np.isfinite(seen).any():
        low, high = np.nanpercentile(seen, _SHOWN_PERCENT, axis=0)
        middle, half = 0.5 * (low + high), 0.5 * max(float((high - low).max()), _MIN_M)
        low, high = middle - half, middle + half
    _frame(near, low, high)
    handles, labels = section.get_legend_handles_labels()
    by_label = dict(zip(labels, handles, strict=True))
    figure.legend(by_label.values(), by_label.keys(), loc="outside lower left", ncols=6, fontsize=8)
    label_axes(resolution, "Angular resolution", "radius in the image (px)", "degrees per pixel")
    pixels = _row(system, _COLUMNS)
    radii_px = pixels[:, 0] - system.principal_point_px[0]
    steps = np.degrees(np.linalg.norm(ray_jacobians(system, pixels).directions, axis=1))
    resolution.plot(radii_px, steps[:, 0], color=ORANGE, label="along the radius")
    resolution.plot(radii_px, steps[:, 1], color=BLUE, label="across it")
    shown = steps[np.isfinite(steps)]
    if len(shown):
        resolution.set_ylim(0.0, 1.1 * float(np.percentile(shown, 99.0)))
    resolution.legend(fontsize=8, framealpha=0.9)
    return figure


def _frame(axes: Axes, low_m: Floats, high_m: Floats) -> None:
    """Show a part of a section between two corners (2,), with a margin."""
    margin_m = _MARGIN * float((high_m - low_m).max())
    show_between(axes, 1e3 * (low_m - margin_m), 1e3 * (high_m + margin_m))


def _row(system: OpticalSystem, count: int) -> Floats:
    """Pixels (count, 2) along the row of the principal point."""
    u = np.linspace(0.0, system.width_px - 1.0, count)
    return np.column_stack((u, np.full(count, system.principal_point_px[1])))


def _draw_section(axes: Axes, system: OpticalSystem, caustic_m: Floats) -> tuple[Floats, Floats]:
    """Draw the section; return the corners (2,) of the part that rays reach."""
    paths = system.paths(_row(system, _RAYS))
    seen = paths.fates == Fate.SEEN
    hits = paths.points_m[:, seen].reshape(-1, 3)
    curves = [_curve(surface, hits) for surface in system.surfaces]
    drawn = np.concatenate([hits, *curves])[:, [0, 2]]
    low, high = np.nanmin(drawn, axis=0), np.nanmax(drawn, axis=0)
    length_m = 30.0 * float((high - low).max())
    # beyond the last surface, and back to their apparent origins
    ends, begins = (paths.points_m[-1] + sign * length_m * paths.directions for sign in (1.0, -1.0))
    for ray in np.flatnonzero(seen):
        path_mm = 1e3 * np.concatenate((paths.points_m[:, ray], ends[ray : ray + 1]))
        axes.plot(path_mm[:, 0], path_mm[:, 2], color=GRAY, linewidth=0.6)
        back = 1e3 * np.stack((begins[ray], paths.points_m[-1, ray]))
        axes.plot(back[:, 0], back[:, 2], color=GRAY, linewidth=0.3, linestyle=":")
    for curve, surface in zip(curves, system.surfaces, strict=True):
        color, label = (BLUE, "mirror") if surface.is_mirror else (GREEN, "boundary")
        axes.plot(1e3 * curve[:, 0], 1e3 * curve[:, 2], color=color, linewidth=2.0, label=label)
    for rod in system.obstacles:
        ends_m = np.array((rod.begin_m[1], rod.end_m[1])) - system.system_from_camera[1, 3]
        is_cut = bool(ends_m.min() <= rod.radius_m and ends_m.max() >= -rod.radius_m)
        style = {"color": "black"} if is_cut else {"fill": False, "linestyle": "--"}
        label = "obstacle" if is_cut else "obstacle beside the section"
        begin, end = np.array((rod.begin_m, rod.end_m))[:, [0, 2]]
        along = end - begin
        length_m = float(np.hypot(*along))
        unit = along / length_m if length_m > 0.0 else np.array([1.0, 0.0])
        aside = rod.radius_m * np.array([-unit[1], unit[0]])
        outline = np.stack((begin - aside, end - aside, end + aside, begin + aside))
        axes.add_patch(Polygon(1e3 * outline, label=label, **style))
    x, _, z = 1e3 * caustic_m.reshape(-1, 3).T
    axes.plot(x, z, ".", color=ORANGE, markersize=2.5, label="caustic")
    x, _, z = 1e3 * system.system_from_camera[:3, 3]
    axes.plot(x, z, "o", color="black", markersize=4.0, label="pinhole")
    return low, high


def _curve(surface: Surface, hits_m: Floats) -> Floats:
    """Section (n, 3) of a surface at y = 0 in its own frame, as far as rays reach; NaN: no surface.

    The points are in the system's frame.
    """
    reach_m = surface.visible_radius_m
    if np.isinf(reach_m):
        local = surface.points_from_system(hits_m)
        reach_m = 1.2 * float(np.hypot(local[:, 0], local[:, 1]).max(initial=1e-3))
    middle = surface.rim_center_m[0]
    x = np.linspace(-reach_m, reach_m, 401)
    z = surface.shape.sag_m(np.abs(x))
    gone = (np.abs(x - middle) > surface.rim_radius_m) | (np.abs(x) < surface.hole_radius_m)
    points = np.column_stack((x, np.zeros_like(x), np.where(gone, np.nan, z)))
    return surface.directions_to_system(points) + surface.system_from_surface[:3, 3]
