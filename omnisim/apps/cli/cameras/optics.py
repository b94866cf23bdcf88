"""`omnisim optics`."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from omnisim.apps.cli.cameras.requests import (
    DESIGN_SIZE_PX,
    PROFILE_POINTS,
    OpticsCheckRequest,
    OpticsDesignRequest,
    OpticsPlotRequest,
    OpticsProfileRequest,
    OpticsRaysRequest,
)
from omnisim.apps.cli.console import out, pluralize
from omnisim.apps.cli.error_table import error_table
from omnisim.cameras import summary
from omnisim.cameras.calibration.ray_table import write_ray_table
from omnisim.cameras.optics.central_view import DISTANCES_M
from omnisim.cameras.optics.centrality import measure_centrality
from omnisim.cameras.optics.design import Design
from omnisim.cameras.optics.lateral_color import lateral_color_px
from omnisim.cameras.optics.media import WAVELENGTHS_UM
from omnisim.cameras.optics.profile_file import sampled, write_profile
from omnisim.cameras.optics.surface import Surface
from omnisim.cameras.optics.system import OpticalSystem
from omnisim.cameras.optics.system_file import input_files, read_optics_file
from omnisim.cameras.optics.tracing import Fate
from omnisim.core.errors import OpticsError
from omnisim.core.files.atomic_file import check_distinct, check_suffix, check_target, write_text
from omnisim.core.short_repr import counted, number_text

_FATES = {
    Fate.OUTSIDE: "outside the lens's own image",
    Fate.MISSED: "pass a surface",
    Fate.RIM: "outside a rim or in a hole",
    Fate.TOTAL_REFLECTION: "totally reflected",
    Fate.SHADOWED: "shadowed",
}


def check(request: OpticsCheckRequest) -> None:
    """Print the shares of pixels by ray outcome, and the errors of a central model by distance."""
    system = read_optics_file(request.system)
    distances_m = (*(request.at_distance or ()), *(request.more_distances or ()))
    centrality = measure_centrality(system, distances_m or DISTANCES_M)
    out.print(f"{request.system}: {_summary(system)}", markup=False)
    out.print(_shares(system), markup=False)
    x, y, z = centrality.viewpoint_m
    mean_mm, max_mm = (
        number_text(1e3 * one, 3) for one in (centrality.misses_m.mean(), centrality.misses_m.max())
    )
    out.print(
        f"best viewpoint: ({x:z.5f}, {y:z.5f}, {z:z.5f}) m in the sensor's optical frame; rays "
        f"miss it by {mean_mm} mm on average, {max_mm} mm at most",
        markup=False,
    )
    apart_px = lateral_color_px(system)
    if len(apart_px):
        drawn = "is drawn" if system.chromatic else "chromatic = true draws it"
        out.print(
            f"lateral color: R and B of far points are {apart_px.mean():.2g} px apart on average, "
            f"{apart_px.max():.2g} px at most; {drawn}",
            markup=False,
        )
    out.print("A central model with the same directions is off, for points")
    out.print(error_table(centrality.errors))


def plot(request: OpticsPlotRequest) -> None:
    """Plot the profile, its rays and caustic, and the resolution."""
    from omnisim.plots.optics_plot import optics_figure
    from omnisim.plots.plot_file import check_plot_target, write_plot

    check_plot_target(request.output)
    _check_distinct(request.output, request.system)
    system = read_optics_file(request.system)
    write_plot(request.output, optics_figure(request.system.name, system))
    out.print(f"{request.output}: {_summary(system)}", markup=False)


def rays(request: OpticsRaysRequest) -> None:
    """Write the rays of all pixels as a ray table."""
    if request.color is not None and request.color not in WAVELENGTHS_UM:
        raise OpticsError(f"--color: expected R, G or B, got {request.color!r}")
    check_suffix(request.output, ".exr")
    check_target(request.output)
    _check_distinct(request.output, request.system)
    system = read_optics_file(request.system)
    if request.color is not None:
        system = system.of_color(request.color)
    write_ray_table(request.output, system)
    out.print(f"{request.output}: {_summary(system)}", markup=False)


def design(request: OpticsDesignRequest) -> None:
    """Write the profile of a designed mirror; for a .toml, also the system that uses it."""
    check_suffix(request.output, ".csv", ".toml")
    is_system = request.output.suffix.lower() == ".toml"
    if request.size_px is not None and not is_system:
        raise OpticsError("--size: expected -o FILE.toml beside it")
    profile_file = request.output.with_suffix(".csv") if is_system else request.output
    for path in dict.fromkeys((request.output, profile_file)):
        check_target(path)
    target = Design(request.distance_m, request.half_angle_deg)
    if (request.equi_angular_deg is None) == (request.equi_ground_m is None):
        raise OpticsError("design: expected either --equi-angular or --equi-ground")
    if request.equi_angular_deg is not None:
        if request.height_m is not None:
            raise OpticsError("--height: expected --equi-ground beside it")
        profile = target.equi_angular(request.equi_angular_deg)
    else:
        assert request.equi_ground_m is not None
        if request.height_m is None:
            raise OpticsError("--equi-ground: expected --height beside it")
        profile = target.equi_ground(request.height_m, request.equi_ground_m)
    write_profile(profile_file, *profile)
    out.print(
        f"{profile_file}: {pluralize(len(profile.radii_m), 'point')}, rim radius "
        f"{1e3 * profile.radii_m[-1]:.4g} mm, height {1e3 * profile.heights_m[-1]:.4g} mm",
        markup=False,
    )
    if is_system:
        size_px = request.size_px or DESIGN_SIZE_PX
        text = target.system_toml(profile_file.name, size_px)
        write_text(request.output, text)
        out.print(f"{request.output}: {_summary(read_optics_file(request.output))}", markup=False)


def profile(request: OpticsProfileRequest) -> None:
    """Write the profile of a surface."""
    check_suffix(request.output, ".csv")
    check_target(request.output)
    _check_distinct(request.output, request.system)
    write_profile_of(request.system, request.surface, request.output, request.points)


def write_profile_of(path: Path, number: int, output: Path, points: int = PROFILE_POINTS) -> None:
    """Write the profile of a surface of an optical system, and print its size.

    Raises:
        OpticsError: no such surface, or it has no rim.
        OutputError: the file cannot be written.
    """
    surface = read_optics_file(path).surface(number, str(path))
    if math.isinf(surface.visible_radius_m):
        raise OpticsError(f"{path}: surfaces.{number}.rim_radius_m: missing")
    write_surface_profile(output, surface, points)


def write_surface_profile(output: Path, surface: Surface, points: int = PROFILE_POINTS) -> None:
    """Write the profile of a surface that has a rim, and print its size.

    Raises:
        OutputError: the file cannot be written.
    """
    radius_m = surface.visible_radius_m
    samples = sampled(surface.shape, radius_m, points)
    write_profile(output, samples.radii_m, samples.heights_m)
    tip = ', tip = "pointed"' if samples.pointed else ""
    out.print(
        f"{output}: {pluralize(points, 'point')} of {surface.name}, radius "
        f"{1e3 * radius_m:.4g} mm{tip}; a spline through them is off by "
        f"{1e9 * samples.deviation_m:.2g} nm at most",
        markup=False,
    )


def _check_distinct(output: Path, system: Path) -> None:
    check_distinct({"what is written": output}, input_files(system))


def _summary(system: OpticalSystem) -> str:
    mirrors = sum(surface.is_mirror for surface in system.surfaces)
    boundaries = len(system.surfaces) - mirrors
    parts = counted(mirrors, "mirror"), counted(boundaries, "boundary", "boundaries")
    return f"{summary(system.camera)}, {' and '.join(filter(None, parts))}"


def _shares(system: OpticalSystem) -> str:
    """Summarize the shares of pixels by the outcome of their rays."""
    fates = system.all_rays().fates
    shares = {fate: 100.0 * float(np.mean(fates == fate)) for fate in Fate}
    others = [
        f"{shares[fate]:.1f} % {description}"
        for fate, description in _FATES.items()
        if shares[fate]
    ]
    return "; ".join([f"{shares[Fate.SEEN]:.1f} % of the pixels see something", *others])
