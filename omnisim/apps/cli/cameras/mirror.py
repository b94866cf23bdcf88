"""`omnisim mirror`."""

from __future__ import annotations

from pathlib import Path

from omnisim.apps.cli.cameras.requests import MirrorRequest
from omnisim.apps.cli.console import out
from omnisim.apps.cli.inputs import read_sensor
from omnisim.cameras import HyperbolicCamera
from omnisim.cameras.mirrors import tessellate
from omnisim.cameras.mirrors.mirror_mesh import MeshError, mesh_error, unfold
from omnisim.core.errors import OpticsError
from omnisim.core.files.atomic_file import check_distinct, check_target
from omnisim.rendering.camera.omnicamera import PAPER_POLYGONS, OmniCamera
from omnisim.rendering.camera.quality import auto_polygons
from omnisim.scene.formats.mesh.other_formats import check_mesh_target, write_mirror


def run(request: MirrorRequest) -> None:
    """Write the mesh and print its size and error, or write the profile."""
    if request.sensor is not None and request.optics is not None:
        raise OpticsError("--sensor, --optics: expected one of them, got both")
    if request.output.suffix.lower() == ".csv":
        _write_profile(request)
        return
    check_mesh_target(request.output)
    if request.optics is not None:
        _write_surface(request, request.optics)
        return
    camera = read_sensor(request.sensor)
    model = _mirror_camera(request, camera)
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
        f"rim radius {1000.0 * model.mirror.rim_radius_m:.4g} mm"
    )
    _print_error(f"in an image {2.0 * model.rim_radius_px:.4g} px wide", error)


def _write_profile(request: MirrorRequest) -> None:
    """Write the profile of the sensor's mirror, or of a surface of an optical system."""
    from omnisim.apps.cli.cameras.optics import write_profile_of, write_surface_profile
    from omnisim.cameras.optics.shapes import Hyperbolic, Plane
    from omnisim.cameras.optics.surface import Surface
    from omnisim.cameras.optics.system_file import input_files

    if request.polygons is not None:
        raise OpticsError("--polygons: expected a mesh, .glb .obj .ply, got a profile")
    check_target(request.output)
    if request.optics is not None:
        check_distinct({"the profile": request.output}, input_files(request.optics))
        write_profile_of(request.optics, request.surface, request.output)
        return
    mirror = _mirror_camera(request, read_sensor(request.sensor)).mirror
    is_plane = mirror.k == 2.0
    shape = Plane() if is_plane else Hyperbolic(mirror.k, mirror.c, mirror.meters_per_unit)
    surface = Surface(shape, rim_radius_m=mirror.rim_radius_m, name="hyperbolic_mirror")
    write_surface_profile(request.output, surface)


def _mirror_camera(request: MirrorRequest, camera: OmniCamera) -> HyperbolicCamera:
    if not isinstance(camera.model, HyperbolicCamera):
        raise OpticsError(
            f"{request.sensor}: expected a mirror, got model {camera.model.model_name!r}"
        )
    return camera.model


def _write_surface(request: MirrorRequest, optics: Path) -> None:
    from omnisim.cameras.optics.mesh_rays import (
        SystemMeshErrors,
        has_mesh,
        mesh_surface,
        rim_of_mesh,
        tessellate_surface,
    )
    from omnisim.cameras.optics.system_file import read_optics_file

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
        f"triangles, rim radius {1000.0 * rim_m:.4g} mm, in its own frame, z toward the camera"
    )
    if is_seen:
        _print_error("in the system's image", SystemMeshErrors(system).of(polygons))


def _print_error(where: str, error: MeshError) -> None:
    out.print(
        f"{where}, off by {error.mean_px:.3g} px on average, {error.percentile_95_px:.3g} px at "
        f"95 %, {error.max_px:.3g} px at most"
    )
