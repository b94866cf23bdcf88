"""`omnisim scan`."""

from __future__ import annotations

import numpy as np

from omnisim.apps.cli.console import out, print_note
from omnisim.apps.cli.images.requests import ScanRequest
from omnisim.apps.cli.inputs import Viewpoint, load_requested_scene
from omnisim.core.errors import OutputError
from omnisim.core.extras import require_extra
from omnisim.core.files.atomic_file import check_target
from omnisim.core.world import WorldState
from omnisim.rendering.reflection_kinds import specular_notes
from omnisim.rendering.stage import open_sensor
from omnisim.sensors.laser_scanner.laser_scanner import LaserScanner


def run(request: ScanRequest) -> None:
    """Render one scan, write it and print a summary."""
    if request.output.suffix.lower() != ".csv":
        raise OutputError(f"--output: expected a .csv file, got {request.output}")
    check_target(request.output)
    if request.plot is not None:
        require_extra("plots", "--plot")
        from omnisim.plots.style import check_plot_target

        check_plot_target(request.plot)
    scanner = LaserScanner.lms200(request.resolution_deg, request.mode, request.seed)
    if not request.noise:
        scanner = scanner.without_noise()
    scene = load_requested_scene(request.world)
    for note in specular_notes(scene, [each.shape for each in scene.objects], "cube"):
        print_note(note)
    viewpoint = Viewpoint.in_scene(scene, request.viewpoint)
    with open_sensor(scene, scanner, device=request.gpu.device) as renderer:
        world = WorldState({renderer.vehicle: viewpoint.pose}, request.viewpoint.time_s)
        scan = renderer.scan(world)
    scan.save_csv(request.output)
    too_near = int(np.isneginf(scan.ranges_m).sum())
    out_of_range = int(np.isposinf(scan.ranges_m).sum())
    out.print(
        f"{request.output}: {scanner.beams} beams at {scanner.resolution_deg:g}° from "
        f"{viewpoint}: {int(scan.hit.sum())} ranges, "
        f"{out_of_range} past {scanner.range_max_m:g} m, "
        f"{too_near} under {scanner.range_min_m:g} m"
    )
    if request.plot is not None:
        from omnisim.plots.scan_plot import scan_figure
        from omnisim.plots.style import write_plot

        write_plot(request.plot, scan_figure(scan))
        out.print(f"{request.plot}: the scan from above")
