"""`omnisim mirror`."""

from __future__ import annotations

from pathlib import Path

from rich.console import Console

from omnisim.cameras import HyperbolicCamera
from omnisim.cli.options import read_sensor
from omnisim.errors import OpticsError
from omnisim.mirrors import tessellate
from omnisim.mirrors.mesh_error import mesh_error
from omnisim.mirrors.unfolding import unfold
from omnisim.scene.mesh_files import check_mesh_target, write_mirror
from omnisim.sensors.omnicamera import PAPER_POLYGONS


def run(output: Path, polygons: int | None, sensor: Path | None, out: Console) -> None:
    """Write the mesh and say what is in it.

    Raises:
        OmnisimError: anything that the user can put right.
    """
    check_mesh_target(output)
    camera = read_sensor(sensor)
    if not isinstance(camera.model, HyperbolicCamera):
        raise OpticsError(f"{sensor}: a camera of model {camera.model.model_name!r} has no mirror")
    mirror = camera.model.mirror
    if polygons is None:
        polygons = camera.polygons or PAPER_POLYGONS
    mesh = tessellate(mirror, polygons)
    unfolded = unfold(mirror, mesh)
    write_mirror(output, unfolded, "hyperbolic_mirror")
    error = mesh_error(mirror, mesh, camera.model.rim_radius_px)
    out.print(
        f"{output}: {mesh.polygons} polygons ({mesh.sectors} sectors × {mesh.rings} rings), "
        f"{len(unfolded.triangles)} triangles once cut along the cube's edges, "
        f"rim radius {1000.0 * mirror.rim_radius_m:.4g} mm",
        markup=False,
    )
    out.print(
        f"in a picture of it {2.0 * camera.model.rim_radius_px:.4g} px wide, off by "
        f"{error.mean_px:.3g} px on average, {error.percentile_95_px:.3g} px at 95 %, "
        f"{error.max_px:.3g} px at most",
        markup=False,
    )
