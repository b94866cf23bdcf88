"""Texture coordinates of geoms: those of MuJoCo's renderer, cut at the edges of a cube."""

import numpy as np
import pytest

pytest.importorskip("mujoco")
from omnisim.scene import primitives
from omnisim.scene.formats.mjcf.meshes import GeomShape, map_cube, map_plane

BOX = primitives.box((1.0, 2.0, 3.0))


def _shape(surface, sizes):
    return GeomShape(surface, None, surface.positions / sizes)


def test_each_side_of_a_box_is_a_face_of_the_cube():
    sizes = np.array([1.0, 2.0, 3.0])
    mapped = map_cube(_shape(BOX, sizes), sizes, is_uniform=False)
    assert [one.face for one in mapped] == [0, 1, 2, 3, 4, 5]
    for one in mapped:
        assert len(one.surface.triangles) == 2
        assert set(one.texture_coordinates.ravel().tolist()) == {0.0, 1.0}
    # OpenGL's table: on the face of +x, right is −z and down is −y
    corners = mapped[0].surface.positions
    right, down = mapped[0].texture_coordinates.T
    assert right == pytest.approx(0.5 - corners[:, 2] / 6.0)
    assert down == pytest.approx(0.5 - corners[:, 1] / 4.0)


def test_uniform_cubes_are_not_stretched_and_triangles_are_cut_at_their_edges():
    sizes = np.array([1.0, 2.0, 3.0])
    mapped = map_cube(_shape(BOX, sizes), sizes, is_uniform=True)
    area = 0.0
    for one in mapped:
        corners = one.surface.positions[one.surface.triangles]
        axis, sign = one.face // 2, 1.0 - 2.0 * (one.face % 2)
        reach = np.abs(corners).max(axis=-1)
        assert sign * corners[..., axis] == pytest.approx(reach)  # that axis is the longest
        across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        area += 0.5 * np.linalg.norm(across, axis=1).sum()
        assert (np.einsum("mi,mi->m", across, corners.mean(axis=1)) > 0.0).all()  # still outwards
    assert area == pytest.approx(2.0 * (2 * 4 + 2 * 6 + 4 * 6))


def test_normals_stay_those_of_a_sphere():
    ball = primitives.ellipsoid((0.5, 0.5, 0.5), 32)
    for one in map_cube(_shape(ball, 0.5), np.full(3, 0.5), is_uniform=False):
        length = np.linalg.norm(one.surface.positions, axis=1, keepdims=True)
        assert one.surface.normals == pytest.approx(one.surface.positions / length, abs=0.01)


@pytest.mark.parametrize(("is_uniform", "across"), [(False, 3.0), (True, 6.0)])
def test_images_repeat_across_the_geom_or_two_meters(is_uniform, across):
    sizes = np.array([2.0, 1.0, 0.1])
    plane = primitives.rectangle(2.0, 1.0)
    mapped = map_plane(
        _shape(plane, np.array([2.0, 1.0, 1.0])), np.float32([3, 3]), sizes, is_uniform
    )
    assert np.ptp(mapped.texture_coordinates[:, 0]) == pytest.approx(across)
    assert np.ptp(mapped.texture_coordinates[:, 1]) == pytest.approx(3.0)
    top = mapped.texture_coordinates[plane.positions[:, 1] > 0.0, 1]
    assert (top < mapped.texture_coordinates[plane.positions[:, 1] < 0.0, 1].min()).all()
