"""Scenes of tests: small ones whose colors can be computed, and a real one where it is."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.scenes import WAREHOUSE
from omnisim.scene.model import Instance, Lighting, Material, Mesh, Scene, StartPose

# The real scene beside the project is an extra run of tests of shipped scenes.
needs_warehouse = pytest.mark.skipif(
    not WAREHOUSE.is_file(), reason=f"{WAREHOUSE.name} is kept outside the project and is not here"
)


def with_warehouse(*shipped, long=False):
    """Parametrises a test by sources of scenes: shipped ones, and the real one, which is slow."""
    marks = [needs_warehouse, pytest.mark.slow, *([pytest.mark.long] if long else [])]
    warehouse = pytest.param(WAREHOUSE, id="warehouse", marks=marks)
    return pytest.mark.parametrize("source", [*shipped, warehouse])


NO_LIGHT = Lighting(ambient=(1.0, 1.0, 1.0), lights=())


def scene_of(meshes, materials=None, poses=None, lighting=NO_LIGHT, background=(0.0, 0.0, 0.0)):
    """Scene of meshes, one instance each."""
    poses = [np.eye(4)] * len(meshes) if poses is None else poses
    return Scene(
        name="test",
        meshes=tuple(meshes),
        materials=tuple(materials or [Material(double_sided=True)]),
        instances=tuple(Instance(f"object {i}", i, pose) for i, pose in enumerate(poses)),
        lighting=lighting,
        background=background,
        start=StartPose((0.0, 0.0, 0.0)),
    )


ROOM_HALF_M = np.array([3.0, 2.0, 1.5])


def room_color(points):
    """Linear RGB of the room's walls at points (..., 3): a different gradient along each axis."""
    return 0.5 + 0.4 * np.asarray(points) / ROOM_HALF_M


def room_hit(origin, directions):
    """Hit points of rays from inside the room on its walls."""
    directions = np.where(np.abs(directions) < 1e-12, 1e-12, directions)
    distances = (np.sign(directions) * ROOM_HALF_M - origin) / directions
    return origin + directions * distances.min(axis=-1, keepdims=True)


def room():
    """A box seen from inside whose vertex colors are linear in position."""
    signs = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    corners = signs * ROOM_HALF_M
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    triangles = [t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))]
    colors = np.concatenate((room_color(corners), np.ones((8, 1))), axis=1)
    return Mesh(
        "room",
        corners.astype(np.float32),
        np.array(triangles, dtype=np.uint32),
        0,
        colors=colors.astype(np.float32),
    )


def square(half_m=5.0, z_m=0.0, material=0, name="square", **options):
    """A horizontal square about the z axis, its front up."""
    corners = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], dtype=np.float32)
    corners = corners * np.float32(half_m) + np.array([0, 0, z_m], dtype=np.float32)
    triangles = np.array([[0, 1, 2], [0, 2, 3]], dtype=np.uint32)
    return Mesh(name, corners, triangles, material, **options)


def upright(half_m=5.0, x_m=0.0, material=0, name="upright", **options):
    """An upright square across x, its front ahead; of half sides along y and z, if two."""
    mesh = square(1.0, material=material, name=name, **options)
    positions = mesh.positions[:, [2, 0, 1]] * np.float32((1.0, *np.broadcast_to(half_m, 2)))
    return replace(mesh, positions=positions + np.float32((x_m, 0.0, 0.0)))


def next_to_another_face(faces):
    """Mask of the pixels beside which another face of the cube begins; faces (height, width)."""
    other = np.zeros(faces.shape, dtype=bool)
    for axis in (0, 1):
        change = np.diff(faces, axis=axis) != 0
        before, after = [slice(None)] * 2, [slice(None)] * 2
        before[axis], after[axis] = slice(None, -1), slice(1, None)
        other[tuple(before)] |= change
        other[tuple(after)] |= change
    return other
