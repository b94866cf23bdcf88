"""`omnisim mirror`."""

from __future__ import annotations

from pathlib import Path

from omnisim.cameras import HyperbolicCamera
from omnisim.cli.console import out
from omnisim.cli.inputs import read_sensor
from omnisim.cli.picture_requests import MirrorRequest
from omnisim.errors import OpticsError
from omnisim.mirrors import tessellate
from omnisim.mirrors.mesh_error import MeshError, mesh_error
from omnisim.mirrors.unfolding import unfold
from omnisim.scene.mesh_files import check_mesh_target, write_mirror
from omnisim.sensors.auto_mesh import auto_polygons
from omnisim.sensors.omnicamera import PAPER_POLYGONS


def run(request: MirrorRequest) -> None:
    """Write the mesh and print its size and error."""
    check_mesh_target(request.output)
    if request.optics is not None:
        _write_surface(request, request.optics)
        return
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
    _print_error(f"in a picture of it {2.0 * model.rim_radius_px:.4g} px wide", error)


def _write_surface(request: MirrorRequest, optics: Path) -> None:
    """Write the mesh of a surface of an optical system, and print its error."""
    from omnisim.optics.mesh_error import SystemMeshErrors
    from omnisim.optics.mesh_rays import has_mesh, mesh_surface
    from omnisim.optics.surface_mesh import rim_of_mesh, tessellate_surface
    from omnisim.optics.system_file import read_optics_file

    if request.sensor is not None:
        raise OpticsError("--sensor, --optics: expected one of them, got both")
    system = read_optics_file(optics)
    surface = system.surface(request.surface, str(optics))
    is_seen = has_mesh(system) and mesh_surface(system) == request.surface
    polygons = request.polygons or (is_seen and auto_polygons(system)) or PAPER_POLYGONS
    mesh = tessellate_surface(surface, polygons, system.system_from_camera[:3, 3])
    rim_m = rim_of_mesh(surface)
    write_mirror(request.output, mesh.as_seen(surface.rim_center_m, rim_m), surface.name)
    out.print(
        f"{request.output}: {surface.name}, {polygons} polygons "
        f"({mesh.sectors} sectors × {polygons // mesh.sectors} rings), {len(mesh.triangles)} "
        f"triangles, rim radius {1000.0 * rim_m:.4g} mm, in its own frame, z towards the camera",
        markup=False,
    )
    if is_seen:
        _print_error("in the system's picture", SystemMeshErrors(system).of(polygons))


def _print_error(where: str, error: MeshError) -> None:
    out.print(
        f"{where}, off by {error.mean_px:.3g} px on average, {error.percentile_95_px:.3g} px at "
        f"95 %, {error.max_px:.3g} px at most",
        markup=False,
    )
