"""`omnisim mirror`."""

from __future__ import annotations

from omnisim.cameras import HyperbolicCamera
from omnisim.cli.console import out
from omnisim.cli.inputs import read_sensor
from omnisim.cli.picture_requests import MirrorRequest
from omnisim.errors import OpticsError
from omnisim.mirrors import tessellate
from omnisim.mirrors.mesh_error import mesh_error
from omnisim.mirrors.unfolding import unfold
from omnisim.scene.mesh_files import check_mesh_target, write_mirror
from omnisim.sensors.omnicamera import PAPER_POLYGONS


def run(request: MirrorRequest) -> None:
    """Write the mesh and print its size and error."""
    check_mesh_target(request.output)
    camera = read_sensor(request.sensor)
    model = camera.model
    if not isinstance(model, HyperbolicCamera):
        raise OpticsError(f"{request.sensor}: expected a mirror, got model {model.model_name!r}")
    polygons = request.polygons
    if polygons is None:
        polygons = camera.mesh_polygons or PAPER_POLYGONS
    mesh = tessellate(model.mirror, polygons)
    unfolded = unfold(model.mirror, mesh)
    write_mirror(request.output, unfolded, "hyperbolic_mirror")
    error = mesh_error(model.mirror, polygons, model.rim_radius_px)
    out.print(
        f"{request.output}: {mesh.polygons} polygons "
        f"({mesh.sectors} sectors × {mesh.rings} rings), "
        f"{len(unfolded.triangles)} triangles once cut along the cube's edges, "
        f"rim radius {1000.0 * model.mirror.rim_radius_m:.4g} mm",
        markup=False,
    )
    out.print(
        f"in a picture of it {2.0 * model.rim_radius_px:.4g} px wide, off by "
        f"{error.mean_px:.3g} px on average, {error.percentile_95_px:.3g} px at 95 %, "
        f"{error.max_px:.3g} px at most",
        markup=False,
    )
