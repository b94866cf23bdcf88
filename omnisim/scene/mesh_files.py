"""Meshes out, through trimesh."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import trimesh
from numpy.typing import NDArray

from omnisim.atomic_file import atomic_write, check_target
from omnisim.errors import OutputError
from omnisim.mirrors.mirror_mesh import UnfoldedMirrorMesh

MIRROR_SUFFIXES = (".glb", ".obj", ".ply")
# glTF has y up, and what reads OBJ mostly assumes it; PLY is written as it is.
_FILE_FROM_Z_UP = {
    ".glb": np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]]),
    ".obj": np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]]),
    ".ply": np.eye(3),
}


def check_mesh_target(path: Path) -> None:
    """Refuse early what could only fail after the work is done.

    Raises:
        OutputError: an unknown format, or a folder that is not there.
    """
    if path.suffix.lower() not in MIRROR_SUFFIXES:
        raise OutputError(
            f"{path}: unknown mesh format {path.suffix or '(no suffix)'!r}: want one of "
            + " ".join(MIRROR_SUFFIXES)
        )
    check_target(path)


def write_mirror(path: Path, mesh: UnfoldedMirrorMesh, name: str) -> None:
    """Write a mirror's mesh as GLB, OBJ or PLY; in Blender its axis z points to the pinhole.

    The material is a perfect mirror; the texture coordinates are of the unfolded cube.

    Raises:
        OutputError: an unknown format, or a file that cannot be written; nothing is left then.
    """
    check_mesh_target(path)
    suffix = path.suffix.lower()
    file_from_z_up = _FILE_FROM_Z_UP[suffix]
    coordinates = mesh.texture_coordinates.copy()
    coordinates[:, 1] = 1.0 - coordinates[:, 1]  # trimesh counts from the bottom
    exported = trimesh.Trimesh(
        vertices=mesh.vertices_m @ file_from_z_up.T,
        faces=mesh.triangles,
        vertex_normals=mesh.normals @ file_from_z_up.T,
        visual=trimesh.visual.TextureVisuals(uv=coordinates, material=_mirror_material(suffix)),
        process=False,
    )
    if suffix == ".glb":
        scene = trimesh.Scene()
        scene.add_geometry(exported, geom_name=name, node_name=name)
        data = scene.export(file_type="glb", include_normals=True)
    elif suffix == ".obj":
        text = exported.export(file_type="obj", include_normals=True, write_texture=False)
        # there is no material file: OBJ cannot say "mirror"
        lines = [line for line in text.split("\n") if not line.startswith(("mtllib", "usemtl"))]
        data = "\n".join(lines)
    else:
        data = _ply(exported, coordinates)
    with atomic_write(path) as partial:
        partial.write_bytes(data.encode() if isinstance(data, str) else data)


def _mirror_material(suffix: str) -> trimesh.visual.material.Material:
    if suffix == ".glb":
        return trimesh.visual.material.PBRMaterial(
            name="mirror", baseColorFactor=[1.0] * 4, metallicFactor=1.0, roughnessFactor=0.0
        )
    return trimesh.visual.material.SimpleMaterial(name="mirror")


def _ply(mesh: trimesh.Trimesh, coordinates: NDArray[np.float64]) -> bytes:
    # Blender and MeshLab read texture coordinates of PLY as the vertex properties s and t
    plain = trimesh.Trimesh(
        vertices=mesh.vertices,
        faces=mesh.faces,
        vertex_normals=mesh.vertex_normals,
        vertex_attributes={
            "s": coordinates[:, 0].astype(np.float32),
            "t": coordinates[:, 1].astype(np.float32),
        },
        process=False,
    )
    return plain.export(file_type="ply", vertex_normal=True, include_attributes=True)
