"""Mesh export, through trimesh (of which mypy ignores what has no annotations)."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import trimesh

from omnisim.cameras.mirrors.mirror_mesh import UnfoldedMirrorMesh
from omnisim.core.errors import OutputError
from omnisim.core.files.atomic_file import atomic_write, check_target

MIRROR_SUFFIXES = (".glb", ".obj", ".ply")
_FILE_FROM_Z_UP = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])


def check_mesh_target(path: Path) -> None:
    """Check early that a mesh can be written to a path.

    Raises:
        OutputError: an unknown format, or a folder that is not there.
    """
    if path.suffix.lower() not in MIRROR_SUFFIXES:
        raise OutputError(
            f"{path}: unknown mesh format: expected one of {' '.join(MIRROR_SUFFIXES)}, "
            f"got {path.suffix or '(no suffix)'!r}"
        )
    check_target(path)


def write_mirror(path: Path, mesh: UnfoldedMirrorMesh, name: str) -> None:
    """Write a mirror's mesh as GLB, OBJ or PLY; in Blender its axis z points to the pinhole.

    The material is a perfect mirror; the texture coordinates are of the unfolded cube.

    Raises:
        OutputError: an unknown format, or a file that cannot be written; nothing is left then.
    """
    check_mesh_target(path)
    u, v = mesh.texture_coordinates.T
    if path.suffix.lower() == ".ply":  # written as it is, without a material
        # Blender and MeshLab read texture coordinates of PLY as the vertex properties s and t
        attributes = {"s": u.astype(np.float32), "t": (1.0 - v).astype(np.float32)}
        plain = trimesh.Trimesh(
            mesh.vertices_m,
            mesh.triangles,
            vertex_normals=mesh.normals,
            vertex_attributes=attributes,
            process=False,
        )
        data = plain.export(file_type="ply", vertex_normal=True, include_attributes=True)
    else:  # glTF has y up, and what reads OBJ mostly assumes it
        exported = trimesh.Trimesh(
            mesh.vertices_m @ _FILE_FROM_Z_UP.T,
            mesh.triangles,
            vertex_normals=mesh.normals @ _FILE_FROM_Z_UP.T,
            visual=trimesh.visual.TextureVisuals(  # type: ignore[no-untyped-call]
                np.stack((u, 1.0 - v), axis=-1),  # trimesh counts from the bottom
                trimesh.visual.material.PBRMaterial(  # type: ignore[no-untyped-call]
                    "mirror", baseColorFactor=[1.0] * 4, metallicFactor=1.0, roughnessFactor=0.0
                ),
            ),
            process=False,
        )
        if path.suffix.lower() == ".glb":
            scene = trimesh.Scene()
            scene.add_geometry(exported, geom_name=name, node_name=name)
            data = scene.export(  # type: ignore[no-untyped-call]
                file_type="glb", include_normals=True
            )
        else:
            data = exported.export(file_type="obj", include_normals=True, write_texture=False)
            # there is no material file: OBJ has no mirrors
            lines = str(data).split("\n")
            data = "\n".join(x for x in lines if not x.startswith(("mtllib", "usemtl")))
    with atomic_write(path) as partial:
        partial.write_bytes(data if isinstance(data, bytes) else str(data).encode())
