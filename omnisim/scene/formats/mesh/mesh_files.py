"""Mesh export through trimesh (mypy ignores its functions without annotations)."""

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
        OutputError: an unknown format or a missing folder.
    """
    if path.suffix.lower() not in MIRROR_SUFFIXES:
        raise OutputError(
            f"{path}: unknown mesh format: expected one of {' '.join(MIRROR_SUFFIXES)}, "
            f"got {path.suffix or '(no suffix)'!r}"
        )
    check_target(path)


def write_mirror(path: Path, mesh: UnfoldedMirrorMesh, name: str) -> None:
    """Write a mirror's mesh as GLB, OBJ or PLY; in Blender its z axis points to the pinhole.

    The material is a perfect mirror, and the texture coordinates are those of the unfolded cube.

    Raises:
        OutputError: an unknown format, or a file that cannot be written; no partial file remains.
    """
    check_mesh_target(path)
    u, v = mesh.texture_coordinates.T
    if path.suffix.lower() == ".ply":  # unchanged axes, no material
        # Blender and MeshLab read the vertex properties s and t as texture coordinates
        attributes = {"s": u.astype(np.float32), "t": (1.0 - v).astype(np.float32)}
        plain = trimesh.Trimesh(
            mesh.vertices_m,
            mesh.triangles,
            vertex_normals=mesh.normals,
            vertex_attributes=attributes,
            process=False,
        )
        data = plain.export(file_type="ply", vertex_normal=True, include_attributes=True)
    else:  # glTF is y up, and most OBJ readers assume that too
        exported = trimesh.Trimesh(
            mesh.vertices_m @ _FILE_FROM_Z_UP.T,
            mesh.triangles,
            vertex_normals=mesh.normals @ _FILE_FROM_Z_UP.T,
            visual=trimesh.visual.TextureVisuals(  # type: ignore[no-untyped-call]
                np.stack((u, 1.0 - v), axis=-1),  # trimesh's v points up
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
            # no material file, because MTL cannot describe mirrors
            lines = str(data).split("\n")
            data = "\n".join(x for x in lines if not x.startswith(("mtllib", "usemtl")))
    with atomic_write(path) as partial:
        partial.write_bytes(data if isinstance(data, bytes) else str(data).encode())
