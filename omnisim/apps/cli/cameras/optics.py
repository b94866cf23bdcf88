"""`omnisim optics`."""

from __future__ import annotations

import math
import os
from pathlib import Path
from typing import Any

import numpy as np

from omnisim.apps.cli.cameras import requests
from omnisim.apps.cli.cameras.calibration import error_table
from omnisim.apps.cli.console import out, pluralize, table
from omnisim.cameras import summary
from omnisim.cameras.calibration.ray_table import write_ray_table
from omnisim.cameras.optics import system_file
from omnisim.cameras.optics.centrality import DISTANCES_M, lateral_color_px, measure_centrality
from omnisim.cameras.optics.profiles import Design, sampled, write_profile
from omnisim.cameras.optics.surface import Fate, Surface
from omnisim.cameras.optics.system import OpticalSystem
from omnisim.cameras.optics.system_calibration import calibrate_system, read_corners
from omnisim.core.arrays import Floats
from omnisim.core.errors import OpticsError
from omnisim.core.files.atomic_file import check_distinct, check_suffix, check_target, write_text
from omnisim.core.files.toml_file import Comment, toml_text
from omnisim.core.short_repr import counted, number_text

_FATES = {
    Fate.OUTSIDE: "outside the lens's own image",
    Fate.MISSED: "miss a surface",
    Fate.RIM: "outside a rim or in a hole",
    Fate.TOTAL_REFLECTION: "totally reflected",
    Fate.SHADOWED: "shadowed",
}


def check(request: requests.OpticsCheckRequest) -> None:
    """Print the shares of pixels by ray outcome, and the errors of a central model by distance."""
    system = system_file.read_optics_file(request.system)
    distances_m = (*(request.at_distance or ()), *(request.more_distances or ()))
    centrality = measure_centrality(system, distances_m or DISTANCES_M)
    out.print(f"{request.system}: {_summary(system)}")
    fates = system.all_rays().fates
    shares = {fate: 100.0 * float(np.mean(fates == fate)) for fate in Fate}
    others = [f"{shares[fate]:.1f} % {text}" for fate, text in _FATES.items() if shares[fate]]
    out.print("; ".join([f"{shares[Fate.SEEN]:.1f} % of the pixels see something", *others]))
    x, y, z = centrality.viewpoint_m
    misses_mm = 1e3 * centrality.misses_m
    mean_mm, max_mm = (number_text(value, 3) for value in (misses_mm.mean(), misses_mm.max()))
    out.print(
        f"best viewpoint: ({x:z.5f}, {y:z.5f}, {z:z.5f}) m in the sensor's optical frame; rays "
        f"miss it by {mean_mm} mm on average, {max_mm} mm at most"
    )
    apart_px = lateral_color_px(system)
    if len(apart_px):
        drawn = "simulated" if system.chromatic else "set chromatic = true to simulate it"
        out.print(
            f"lateral color: R and B of far points are {apart_px.mean():.2g} px apart on average, "
            f"{apart_px.max():.2g} px at most; {drawn}"
        )
    out.print("error of a central model with the same directions, by the distance of points")
    out.print(error_table(centrality.errors))


def plot(request: requests.OpticsPlotRequest) -> None:
    """Plot the profile, its rays and caustic, and the resolution."""
    from omnisim.plots.optics_plot import optics_figure
    from omnisim.plots.style import check_plot_target, write_plot

    check_plot_target(request.output)
    _check_distinct(request.output, request.system)
    system = system_file.read_optics_file(request.system)
    write_plot(request.output, optics_figure(request.system.name, system))
    out.print(f"{request.output}: {_summary(system)}")


def rays(request: requests.OpticsRaysRequest) -> None:
    """Write the rays of all pixels as a ray table."""
    check_suffix(request.output, ".exr")
    check_target(request.output)
    _check_distinct(request.output, request.system)
    system = system_file.read_optics_file(request.system)
    if request.color is not None:
        system = system.of_color(request.color)
    write_ray_table(request.output, system)
    out.print(f"{request.output}: {_summary(system)}")


def design(request: requests.OpticsDesignRequest) -> None:
    """Write the profile of a designed mirror; for a .toml, also the system that uses it."""
    check_suffix(request.output, ".csv", ".toml")
    is_system = request.output.suffix.lower() == ".toml"
    if request.size_px is not None and not is_system:
        raise OpticsError("--size: requires -o FILE.toml")
    profile_file = request.output.with_suffix(".csv") if is_system else request.output
    for path in dict.fromkeys((request.output, profile_file)):
        check_target(path)
    target = Design(request.distance_m, request.half_angle_deg)
    if (request.equi_angular_deg is None) == (request.equi_ground_m is None):
        raise OpticsError("design: expected either --equi-angular or --equi-ground")
    if request.equi_angular_deg is not None:
        if request.height_m is not None:
            raise OpticsError("--height: requires --equi-ground")
        profile = target.equi_angular(request.equi_angular_deg)
    else:
        assert request.equi_ground_m is not None
        if request.height_m is None:
            raise OpticsError("--equi-ground: requires --height")
        profile = target.equi_ground(request.height_m, request.equi_ground_m)
    write_profile(profile_file, *profile)
    out.print(
        f"{profile_file}: {pluralize(len(profile.radii_m), 'point')}, rim radius "
        f"{1e3 * profile.radii_m[-1]:.4g} mm, height {1e3 * profile.heights_m[-1]:.4g} mm"
    )
    if is_system:
        text = target.system_toml(profile_file.name, request.size_px or requests.DESIGN_SIZE_PX)
        write_text(request.output, text)
        out.print(f"{request.output}: {_summary(system_file.read_optics_file(request.output))}")


def profile(request: requests.OpticsProfileRequest) -> None:
    """Write the profile of a surface."""
    check_suffix(request.output, ".csv")
    check_target(request.output)
    _check_distinct(request.output, request.system)
    write_profile_of(request.system, request.surface, request.output, request.points)


def write_profile_of(
    path: Path, number: int, output: Path, points: int = requests.PROFILE_POINTS
) -> None:
    """Write the profile of a surface of an optical system, and print its size."""
    surface = system_file.read_optics_file(path).surface(number, str(path))
    if math.isinf(surface.visible_radius_m):
        raise OpticsError(f"{path}: surfaces.{number}.rim_radius_m: missing")
    write_surface_profile(output, surface, points)


def write_surface_profile(
    output: Path, surface: Surface, points: int = requests.PROFILE_POINTS
) -> None:
    """Write the profile of a surface that has a rim, and print its size."""
    radius_m = surface.visible_radius_m
    samples = sampled(surface.shape, radius_m, points)
    write_profile(output, samples.radii_m, samples.heights_m)
    tip = ', tip = "pointed"' if samples.pointed else ""
    out.print(
        f"{output}: {pluralize(points, 'point')} of {surface.name}, radius "
        f"{1e3 * radius_m:.4g} mm{tip}; a spline through them is off by "
        f"{1e9 * samples.deviation_m:.2g} nm at most"
    )


def _check_distinct(output: Path, system: Path) -> None:
    check_distinct({"the output": output}, system_file.input_files(system))


def _summary(system: OpticalSystem) -> str:
    mirrors = sum(surface.is_mirror for surface in system.surfaces)
    boundaries = len(system.surfaces) - mirrors
    parts = counted(mirrors, "mirror"), counted(boundaries, "boundary", "boundaries")
    return f"{summary(system.camera)}, {' and '.join(filter(None, parts))}"


def calibrate(request: requests.OpticsCalibrateRequest) -> None:
    """Fit an optical system to corners, write it, and print parameters and residuals."""
    check_suffix(request.output, ".toml")
    check_target(request.output)
    check_distinct(
        {"the output": request.output},
        {"the optics file": request.system, "the file of corners": request.corners},
    )
    file = system_file.read_optics_tables(request.system)
    system_file.parse_optics(*file)  # reports faults with the names of the keys
    keys = [key.strip() for key in request.free.split(",")]
    boards = read_corners(request.corners)
    fit = calibrate_system(file.table, keys, boards, file.source)
    corners = sum(len(board.points_m) for board in boards)
    summary = (
        f"{pluralize(len(boards), 'image')}, {pluralize(corners, 'corner')}: RMS "
        f"{number_text(_rms(fit.before_px), 3)} px before, "
        f"{number_text(_rms(fit.errors_px), 3)} px after, at most "
        f"{number_text(np.linalg.norm(fit.errors_px, axis=1).max(), 3)} px"
    )
    lines = [f"Fitted to {request.corners.name}: {summary}."]
    lines += [
        f"{fitted.name}: {number_text(fitted.value, 6, 9)} ± {number_text(fitted.sigma, 2, 9)}"
        for fitted in fit.parameters
    ]
    tables = _beside(fit.table, request.system.parent, request.output.parent)
    text = toml_text({f"# {line}": Comment(line) for line in lines} | tables)
    write_text(request.output, text)
    out.print(f"{request.output}: {summary}")
    shown = table("", ">before", ">fitted", ">±")
    for fitted in fit.parameters:
        values = (number_text(value, 6, 9) for value in (fitted.before, fitted.value))
        shown.add_row(fitted.name, *values, number_text(fitted.sigma, 2, 9))
    out.print(shown)


def _rms(errors_px: Floats) -> float:
    """Root mean square of errors (n, 2) along each image axis, px."""
    return float(np.sqrt(np.mean(errors_px * errors_px)))


def _beside(table: dict[str, Any], old: Path, new: Path) -> dict[str, Any]:
    """Rebase the table's relative file names from the old folder to the new one."""

    def moved(part: dict[str, Any], key: str) -> dict[str, Any]:
        if not isinstance(part.get(key), str):
            return part
        return {**part, key: os.path.relpath(old / part[key], new)}

    if old.resolve() == new.resolve():
        return table
    surfaces = [moved(part, "file") for part in table["surfaces"]]
    return {**table, "camera": moved(table["camera"], "calibration"), "surfaces": surfaces}
