"""An optical system: its profile with rays and caustic, and its resolution."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Polygon
from numpy.typing import NDArray

from omnisim.optics import OpticalSystem, Rod, Surface, caustic_points, ray_jacobians
from omnisim.optics.tracing import Fate
from omnisim.plots.style import BLUE, DPI, GREEN, GREY, ORANGE, label_axes

_RAYS = 25  # drawn
_COLUMNS = 400  # of the picture, for caustic and resolution
_MARGIN = 0.15  # of the drawn part's size, around the surfaces
Floats = NDArray[np.float64]


def optics_figure(name: str, system: OpticalSystem) -> Figure:
    """Section along the row of the principal point, and degrees a pixel along that row."""
    figure = Figure(figsize=(12.0, 5.6), dpi=DPI, layout="constrained")
    section, resolution = figure.subplots(1, 2)
    label_axes(section, f"{name}: rays, and where they meet", "x (mm)", "z (mm)")
    _draw_section(section, system)
    label_axes(resolution, "Angular resolution", "u (px)", "degrees a pixel")
    _draw_resolution(resolution, system)
    return figure


def _row(system: OpticalSystem, count: int) -> Floats:
    """Pixels (count, 2) along the row of the principal point."""
    u = np.linspace(0.0, system.width_px - 1.0, count)
    return np.column_stack((u, np.full(count, system.principal_point_px[1])))


def _draw_section(axes: Axes, system: OpticalSystem) -> None:
    paths = system.paths(_row(system, _RAYS))
    seen = paths.fates == Fate.SEEN
    hits = np.concatenate([paths.points_m[:, seen].reshape(-1, 3)])
    curves = [_curve(surface, hits) for surface in system.surfaces]
    drawn = np.concatenate([hits, *curves])[:, [0, 2]]
    low, high = np.nanmin(drawn, axis=0), np.nanmax(drawn, axis=0)
    size_m = float((high - low).max())
    ends = paths.points_m[-1] + 3.0 * size_m * paths.directions
    for ray in np.flatnonzero(seen):
        way = 1e3 * np.concatenate((paths.points_m[:, ray], ends[ray : ray + 1]))
        axes.plot(way[:, 0], way[:, 2], color=GREY, linewidth=0.6)
    for curve, surface in zip(curves, system.surfaces, strict=True):
        color = BLUE if surface.is_mirror else GREEN
        axes.plot(1e3 * curve[:, 0], 1e3 * curve[:, 2], color=color, linewidth=2.0)
    for rod in system.obstacles:
        axes.add_patch(Polygon(1e3 * _outline(rod), color="black"))
    points_m = caustic_points(system, _row(system, _COLUMNS)) + system.origin_m
    axes.plot(*(1e3 * points_m.reshape(-1, 3)[:, [0, 2]].T), ".", color=ORANGE, markersize=2.5)
    axes.plot(*(1e3 * system.system_from_camera[[0, 2], 3]), "o", color="black", markersize=4.0)
    margin_m = _MARGIN * size_m
    axes.set_aspect("equal")
    axes.set_xlim(1e3 * (low[0] - margin_m), 1e3 * (high[0] + margin_m))
    axes.set_ylim(1e3 * (low[1] - margin_m), 1e3 * (high[1] + margin_m))
    kinds = {surface.is_mirror: surface for surface in system.surfaces}
    handles = [
        axes.plot([], [], color=color, linewidth=2.0, label=label)[0]
        for is_mirror, color, label in ((True, BLUE, "mirror"), (False, GREEN, "boundary"))
        if is_mirror in kinds
    ]
    handles += [
        axes.plot([], [], ".", color=ORANGE, label="caustic")[0],
        axes.plot([], [], "o", color="black", markersize=4.0, label="pinhole")[0],
    ]
    axes.legend(handles=handles, fontsize=8, loc="upper center", bbox_to_anchor=(0.5, -0.1), ncol=4)


def _curve(surface: Surface, hits_m: Floats) -> Floats:
    """Section (n, 3) of a surface with its own plane y = 0, as far as rays need it."""
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


def _outline(rod: Rod) -> Floats:
    """Outline (4, 2) of a rod seen along y: its sides, as flat as they are seen."""
    begin, end = np.array((rod.begin_m, rod.end_m))[:, [0, 2]]
    along = end - begin
    length_m = float(np.hypot(*along))
    unit = along / length_m if length_m > 0.0 else np.array([1.0, 0.0])
    aside = rod.radius_m * np.array([-unit[1], unit[0]])
    return np.stack((begin - aside, end - aside, end + aside, begin + aside))


def _draw_resolution(axes: Axes, system: OpticalSystem) -> None:
    pixels = _row(system, _COLUMNS)
    steps = np.degrees(np.linalg.norm(ray_jacobians(system, pixels).directions, axis=1))
    axes.plot(pixels[:, 0], steps[:, 0], color=ORANGE, label="along the row")
    axes.plot(pixels[:, 0], steps[:, 1], color=BLUE, label="across it")
    shown = steps[np.isfinite(steps)]
    if len(shown):
        axes.set_ylim(0.0, 1.1 * float(np.percentile(shown, 99.0)))
    axes.legend(fontsize=8, framealpha=0.9)
