"""The exported mirror: cut along the cube's edges, textured by point projection, no cracks."""

import math
from collections import Counter

import numpy as np
import pytest
import trimesh

from omnisim.cameras.mirrors import HyperbolicMirror, tessellate
from omnisim.cameras.mirrors.mirror_mesh import RIG_FROM_MIRROR, unfold
from omnisim.core.cube import CELL_TANGENT, FACE_FROM_RIG, FACE_NAMES, LAYOUT_CELLS, face_index
from omnisim.core.errors import OutputError
from omnisim.scene import load_scene
from omnisim.scene.formats.mesh.other_formats import write_mirror


def _unfolded(polygons, theta_max_deg=105):
    mirror = HyperbolicMirror(theta_max_rad=math.radians(theta_max_deg))
    return mirror, unfold(mirror, tessellate(mirror, polygons))


CASES = ((16, 105), (100, 105), (1024, 105), (1000, 150), (8, 60))
cases = pytest.mark.parametrize(
    ("mirror", "unfolded"), [pytest.param(*_unfolded(*case), id=f"{case}") for case in CASES]
)


@cases
def test_it_is_on_the_mirror_without_cracks_and_overlaps(mirror, unfolded):
    """Welded by position again it is one disc: each inner edge twice, once each way."""
    assert np.abs(mirror.equation_residual(unfolded.vertices_m)).max() < 1e-12
    np.testing.assert_allclose(np.linalg.norm(unfolded.normals, axis=1), 1.0)
    keys = np.round(unfolded.vertices_m / mirror.c_m, 12) + 0.0
    _, welded = np.unique(keys, axis=0, return_inverse=True)
    triangles = welded.reshape(-1)[unfolded.triangles]
    directed = Counter(map(tuple, triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2).tolist()))
    assert max(directed.values()) == 1
    border = {edge for edge in directed if edge[::-1] not in directed}
    starts, ends = ({edge[i] for edge in border} for i in (0, 1))
    assert starts == ends  # a closed line ...
    assert len(starts) == len(border)  # ... that runs around the rim once
    vertices = len(np.unique(triangles))
    edges = (len(directed) + len(border)) // 2
    assert vertices - edges + len(triangles) == 1  # Euler: a disc, no holes


@cases
def test_each_triangle_lies_in_one_face_and_its_texture_there(mirror, unfolded):
    corners = unfolded.vertices_m[unfolded.triangles]
    faces = face_index(corners.mean(axis=1) @ RIG_FROM_MIRROR.T)
    cells = np.array(LAYOUT_CELLS)[faces][:, None]
    # from the image back to the direction: tangents in the face, then the face's own frame
    inside = unfolded.texture_coordinates[unfolded.triangles] * (3, 2) - cells
    tangents = (2.0 * inside - 1.0) * CELL_TANGENT
    assert np.abs(tangents).max() <= 1.0 + 1e-12
    local = np.concatenate((tangents, np.ones((*tangents.shape[:2], 1))), axis=-1)
    rig = np.einsum("nij,nki->nkj", FACE_FROM_RIG[faces], local)
    directions = rig @ RIG_FROM_MIRROR
    sine = np.linalg.norm(np.cross(directions, corners), axis=-1) / (
        np.linalg.norm(directions, axis=-1) * np.linalg.norm(corners, axis=-1)
    )
    assert sine.max() < 1e-9
    assert np.all(np.sum(directions * corners, axis=-1) > 0.0)


def test_paper_mirror_uses_five_faces():
    _, unfolded = _unfolded(1024)
    middle = unfolded.vertices_m[unfolded.triangles].mean(axis=1)
    seen = {FACE_NAMES[face] for face in face_index(middle @ RIG_FROM_MIRROR.T)}
    assert seen == {"front", "left", "back", "right", "down"}


@pytest.mark.parametrize("suffix", [".glb", ".obj", ".ply"])
def test_file_is_read_back_the_same(tmp_path, suffix):
    _, unfolded = _unfolded(64)
    path = tmp_path / f"mirror{suffix}"
    write_mirror(path, unfolded, "hyperbolic_mirror")
    assert [entry.name for entry in tmp_path.iterdir()] == [path.name]
    scene = load_scene(path)
    # a mirror is a metal, which is drawn matt
    assert not [notice for notice in scene.notices if "metals" not in notice]
    assert scene.triangle_count == len(unfolded.triangles)
    mesh, placed = scene.meshes[0], scene.instances[0]
    world = mesh.positions @ placed.world_from_mesh[:3, :3].T + placed.world_from_mesh[:3, 3]
    # float32, or OBJ's eight decimals, of millimeters
    np.testing.assert_allclose(
        world[mesh.triangles].mean(axis=1),
        unfolded.vertices_m[unfolded.triangles].mean(axis=1),
        atol=2e-8,
    )
    np.testing.assert_allclose(
        mesh.texture_coordinates[mesh.triangles].mean(axis=1)
        if mesh.texture_coordinates is not None
        else _ply_coordinates(path),
        unfolded.texture_coordinates[unfolded.triangles].mean(axis=1),
        atol=1e-6,
    )


def _ply_coordinates(path):
    loaded = trimesh.load_mesh(path, process=False)
    data = loaded.metadata["_ply_raw"]["vertex"]["data"]
    coordinates = np.stack((data["s"].ravel(), 1.0 - data["t"].ravel()), axis=-1)
    return coordinates[loaded.faces].mean(axis=1)


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("m.stl", r"unknown mesh format: .*, got '\.stl'"),
        ("file/m.glb", "file: is a file: expected a folder"),
    ],
)
def test_bad_targets(tmp_path, name, words):
    (tmp_path / "file").touch()
    with pytest.raises(OutputError, match=words):
        write_mirror(tmp_path / name, _unfolded(16)[1], "m")
