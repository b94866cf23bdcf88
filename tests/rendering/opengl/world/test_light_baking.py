"""Baking of directional light: the triangles that allow it, and their values."""

from dataclasses import replace

import numpy as np
import pytest

from omnisim.rendering.opengl.gl.buffers import read_buffer
from omnisim.rendering.opengl.world.clustered_geometry import (
    Shading,
    bake_directional_light,
    shadings,
)
from omnisim.rendering.opengl.world.scene_buffers import SceneBuffers
from omnisim.rendering.opengl.world.vertex_records import CLUSTER_VERTEX
from omnisim.scene.model import Light, Lighting, LightKind, Material, Mesh
from tests.rendering.opengl.cluster_readback import lights_of, read_vertices
from tests.rendering.opengl.sheets import LAMP, SUN
from tests.scenes import scene_of

UP, LEANING, DOWN, NONE = (0.0, 0.0, 1.0), (0.6, 0.0, 0.8), (0.0, 0.0, -1.0), (0.0, 0.0, 0.0)
CORNERS = ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
LIGHTING = Lighting((0.1, 0.2, 0.3), (SUN,))


def _shading(normals, materials=(7, 7, 7), corners=CORNERS, lighting=LIGHTING):
    vertices = np.zeros(3, dtype=CLUSTER_VERTEX)
    vertices["in_position"], vertices["in_material"] = corners, materials
    normals, triangles = np.array(normals, dtype=np.float32), np.array([[0, 1, 2]], np.uint32)
    values, directions = shadings(
        vertices, normals, triangles, lighting, np.ones(1, dtype=np.bool_)
    )
    return Shading(values[0]), directions[0]


@pytest.mark.parametrize("normal", [UP, LEANING])
def test_light_of_a_flat_triangle_is_known(normal):
    kind, direction = _shading(3.0 * np.array([normal] * 3))
    assert kind is Shading.BAKED
    np.testing.assert_allclose(direction, normal, atol=1e-7)


def test_a_triangle_without_normals_has_its_own():
    kind, direction = _shading([NONE] * 3)
    assert kind is Shading.BAKED
    np.testing.assert_array_equal(direction, UP)


@pytest.mark.parametrize(
    ("normals", "kind"),
    [
        ([UP, UP, LEANING], Shading.NORMALS_AGREE),
        ([UP, LEANING, UP], Shading.NORMALS_AGREE),
        ([UP, UP, (1e-3, 0.0, 1.0)], Shading.NORMALS_AGREE),
        ([UP, UP, NONE], Shading.UNKNOWN),
        ([NONE, UP, UP], Shading.UNKNOWN),
        ([UP, UP, DOWN], Shading.UNKNOWN),
        ([DOWN, DOWN, DOWN], Shading.UNKNOWN),
    ],
)
def test_light_of_another_triangle_is_not(normals, kind):
    assert _shading(normals)[0] is kind


def test_many_colors_no_area_and_punctual_lights_are_not_baked():
    for materials in ((7, 8, 7), (7, 7, 8)):
        assert _shading([UP] * 3, materials)[0] is Shading.NORMALS_AGREE
    assert _shading([UP] * 3)[0] is Shading.BAKED
    assert _shading([NONE] * 3, corners=[CORNERS[0]] * 3)[0] is Shading.UNKNOWN
    beside = Lighting((0.1, 0.2, 0.3), (SUN, LAMP))
    assert _shading([UP] * 3, lighting=beside)[0] is Shading.NORMALS_AGREE


def test_light_that_shadows_may_fall_on_is_not_baked():
    sun = replace(SUN, casts_shadow=True)
    shadowed = Lighting((0.1, 0.2, 0.3), (sun,))
    assert _shading([UP] * 3, lighting=shadowed)[0] is Shading.NORMALS_AGREE
    from_below = Lighting((0.1, 0.2, 0.3), (replace(sun, direction=np.array(UP)),))
    assert _shading([UP] * 3, lighting=from_below)[0] is Shading.BAKED


def test_light_is_lamberts():
    sun = Light(LightKind.DIRECTIONAL, (1.0, 0.5, 0.25), 2.0, direction=np.array(DOWN))
    lighting = Lighting((0.1, 0.2, 0.3), (sun,), exposure=0.5)
    light = bake_directional_light(np.array([UP, DOWN, LEANING], dtype=np.float32), lighting)
    expected = [(1.1, 0.7, 0.55), (0.1, 0.2, 0.3), (0.9, 0.6, 0.5)]
    np.testing.assert_allclose(light, expected, rtol=1e-6)


def test_vertices_of_two_triangles_that_differ_are_copied(context):
    """A roof of two flat sides and no normals, and one that bends, on the same vertices."""
    positions = np.array([[0, 0, 0], [2, 0, 0], [2, 1, 1], [0, 1, 1], [0, 2, 0]], np.float32)
    flat = Mesh("flat", positions, np.array([[0, 1, 2], [0, 2, 3], [3, 2, 4]], np.uint32), 0)
    normals = np.array([(0, -1, 1), (0, -1, 1), (0, -1, 1), (0, 0, 1), (0, 1, 1)], np.float32)
    bent = Mesh("bent", positions, flat.triangles, 0, normals=normals)
    for mesh, kinds in ((flat, [2, 2, 2]), (bent, [2, 1, 0])):
        scene = scene_of([mesh], [Material()], lighting=LIGHTING)
        geometry = SceneBuffers(context, scene).clustered_geometry
        vertices, triangles = read_vertices(geometry), geometry.triangles
        assert (geometry.normals is None) == (mesh is flat)
        buckets = np.repeat(geometry.bucket_of_cluster, geometry.clusters.triangles)
        found = [geometry.buckets[bucket].shading.value for bucket in buckets]
        assert sorted(found) == sorted(kinds)
        for triangle, kind in zip(triangles, found, strict=True):
            corners = vertices["in_position"][triangle]
            if kind == Shading.BAKED.value:
                own = np.cross(corners[1] - corners[0], corners[2] - corners[0])
                own = (own / np.linalg.norm(own))[None]
                expected = np.repeat(bake_directional_light(own, LIGHTING), 3, axis=0)
                stored = lights_of(geometry, vertices[triangle])
                np.testing.assert_allclose(stored, expected, atol=1e-4)
            else:
                at = corners + geometry.anchor_m
                numbers = [np.flatnonzero((positions == corner).all(axis=1))[0] for corner in at]
                stored = np.frombuffer(read_buffer(geometry.normals), dtype="<f4").reshape(-1, 3)
                np.testing.assert_array_equal(stored[triangle], normals[numbers])
