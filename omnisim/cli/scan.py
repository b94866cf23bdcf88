"""`omnisim scan`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from rich.console import Console

from omnisim.atomic_file import check_target
from omnisim.errors import OutputError
from omnisim.plots.plot_file import check_plot_target, write_plot
from omnisim.plots.scan_plot import scan_figure
from omnisim.poses import pose
from omnisim.scene import load_scene
from omnisim.sensors import LaserRenderer, LaserScanner


@dataclass(frozen=True)
class ScanRequest:
    """The arguments of the command, as its help explains them."""

    scene: str
    output: Path
    plot: Path | None
    at: tuple[float, float, float] | None
    yaw_deg: float | None
    resolution_deg: float
    mode: str
    noise: bool
    seed: int
    up_axis: str | None
    device: int | None


def run(request: ScanRequest, out: Console, err: Console) -> None:
    """Take one scan and say where it is.

    Raises:
        OmnisimError: anything that the user can put right.
    """
    if request.output.suffix.lower() != ".csv":
        raise OutputError(f"{request.output}: unknown format for a scan: want .csv")
    check_target(request.output)
    if request.plot is not None:
        check_plot_target(request.plot)
    scanner = LaserScanner.lms200(request.resolution_deg, request.mode, request.seed)
    if not request.noise:
        scanner = scanner.without_noise()
    scene = load_scene(request.scene, request.up_axis)
    for notice in scene.notices:
        err.print("note: ", notice, sep="", markup=False)
    position = scene.start.position_m if request.at is None else request.at
    yaw_deg = scene.start.yaw_deg if request.yaw_deg is None else request.yaw_deg
    world_from_scanner = pose(position, yaw_deg=yaw_deg)
    with LaserRenderer(scene, scanner, device=request.device) as renderer:
        scan = renderer.scan(world_from_scanner)
    scan.save_csv(request.output)
    x, y, z = position
    too_near = int(np.isneginf(scan.ranges_m).sum())
    out_of_range = int(np.isposinf(scan.ranges_m).sum())
    out.print(
        f"{request.output}: {scanner.beams} beams at {scanner.resolution_deg:g}° from "
        f"({x:g}, {y:g}, {z:g}) m at yaw {yaw_deg:g}°: {int(scan.hit.sum())} ranges, "
        f"{out_of_range} past {scanner.range_max_m:g} m, "
        f"{too_near} under {scanner.range_min_m:g} m",
        markup=False,
    )
    if request.plot is not None:
        write_plot(request.plot, scan_figure(scan))
        out.print(f"{request.plot}: the scan from above", markup=False)
