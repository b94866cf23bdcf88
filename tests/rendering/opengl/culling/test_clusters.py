"""Clusters of triangles beside brute force: every triangle, in its box and in its cone."""

import numpy as np
import pytest

from omnisim.rendering.opengl.culling import clusters as clusters_module
from omnisim.rendering.opengl.culling.clusters import (
    MAX_CHILDREN,
    MAX_TRIANGLES,
    MIN_TRIANGLES,
    bound_clusters,
    build_clusters,
)


def _corners(count, large=0, seed=5):
    """Random triangles (count, 3, 3), some of them as large as all of the rest."""
    generator = np.random.default_rng(seed)
    centers = generator.uniform(-8.0, 8.0, (count, 1, 3))
    sizes = np.where(np.arange(count) < large, 8.0, 0.3)[:, None, None]
    corners = centers + sizes * generator.uniform(-1.0, 1.0, (count, 3, 3))
    return generator.permutation(corners).astype(np.float32)


def _sphere():
    """Triangles (n, 3, 3) of a unit sphere: clusters of it are narrow cones."""
    theta, phi = np.meshgrid(np.linspace(0.0, np.pi, 41), np.linspace(0.0, 2.0 * np.pi, 81))
    points = np.stack(
        (np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)), axis=-1
    )
    a, b, c, d = points[:-1, :-1], points[:-1, 1:], points[1:, 1:], points[1:, :-1]
    triangles = np.stack((a, b, c, a, c, d), axis=-2).reshape(-1, 3, 3)
    return triangles.astype(np.float32)  # fronts outside; those at the poles have no area


SCENES = {
    "none large": _corners(1000),
    "some large": _corners(1000, 70),
    "all large": _corners(200, 200),
    "one cluster": _corners(MAX_TRIANGLES),
    "one more than a cluster": _corners(MAX_TRIANGLES + 1),
    "one triangle": _corners(1),
    "all in one place": np.repeat(_corners(1), 150, axis=0),
    "a sphere": _sphere(),
}
scenes = pytest.mark.parametrize("corners", SCENES.values(), ids=SCENES.keys())


def _batches(corners, count=3, seed=7):
    """Batches (n,) of triangles at random, some of which nothing has."""
    return np.random.default_rng(seed).integers(0, count, len(corners)) * 2


def _built(corners, batches=None):
    keys = np.zeros(len(corners), dtype=int) if batches is None else batches
    made = build_clusters(corners, keys, keys // 4)
    return corners[made.order], made.clusters, made


@scenes
def test_every_triangle_is_in_one_cluster_of_one_batch(corners):
    batches = _batches(corners)
    _, clusters, made = _built(corners, batches)
    assert np.array_equal(np.sort(made.order), np.arange(len(corners)))
    assert clusters.first[0] == 0
    assert np.array_equal(clusters.first[1:], np.cumsum(clusters.triangles)[:-1])
    assert clusters.triangles.sum() == len(corners)
    assert clusters.triangles.min() >= 1
    assert clusters.triangles.max() <= MAX_TRIANGLES
    own = batches[made.order]
    assert np.array_equal(own, np.repeat(own[clusters.first], clusters.triangles))


@scenes
@pytest.mark.parametrize("at_once", [1, 100])
def test_clusters_do_not_depend_on_how_many_are_bounded_at_once(corners, at_once, monkeypatch):
    whole = _built(corners, _batches(corners))[2]
    monkeypatch.setattr(clusters_module, "_BOUND_AT_ONCE", at_once)
    made = _built(corners, _batches(corners))[2]
    assert np.array_equal(made.order, whole.order)
    for cluster, other in zip(made.clusters, whole.clusters, strict=True):
        assert np.array_equal(cluster, other)


@scenes
def test_every_cluster_is_in_one_group_which_bounds_it(corners):
    batches = _batches(corners)
    _, clusters, made = _built(corners, batches)
    groups = made.groups
    assert groups.first[0] == 0
    assert np.array_equal(groups.first[1:], np.cumsum(groups.children)[:-1])
    assert groups.children.sum() == len(clusters.first)
    assert groups.children.max() <= MAX_CHILDREN
    keys = (batches // 4)[made.order][clusters.first]
    of_group = keys[groups.first]
    assert np.array_equal(keys, np.repeat(of_group, groups.children))
    assert np.all(np.diff(of_group) >= 0)
    for number, (first, count) in enumerate(zip(groups.first, groups.children, strict=True)):
        own = slice(first, first + count)
        assert np.array_equal(groups.aabb_min[number], clusters.aabb_min[own].min(axis=0))
        assert np.array_equal(groups.aabb_max[number], clusters.aabb_max[own].max(axis=0))


@scenes
def test_boxes_are_around_their_triangles_and_cones_around_their_normals(corners):
    corners, clusters, _ = _built(corners)
    exact = corners.astype(np.float64)
    normals = np.cross(exact[:, 1] - exact[:, 0], exact[:, 2] - exact[:, 0])
    lengths = np.linalg.norm(normals, axis=1)
    for number, (first, count) in enumerate(zip(clusters.first, clusters.triangles, strict=True)):
        own = slice(first, first + count)
        assert np.array_equal(clusters.aabb_min[number], corners[own].min(axis=(0, 1)))
        assert np.array_equal(clusters.aabb_max[number], corners[own].max(axis=(0, 1)))
        width = np.sqrt(0.5 * lengths[own].mean())  # of squares: the mean triangle's side
        few = min(MIN_TRIANGLES / count, 1.0)
        assert clusters.widths[number] == pytest.approx(width * few**0.25, rel=1e-4)
        has_area = lengths[own] > 1e-9
        units = normals[own][has_area] / lengths[own][has_area, None]
        cosines = units @ clusters.cone_axes[number].astype(np.float64)
        # the cone's opening is a sine of float32, whose last digits are worth up to this angle
        if clusters.cone_sines[number] <= 1.0:
            angles = np.arccos(np.clip(cosines, -1.0, 1.0))
            assert angles.max() <= np.arcsin(clusters.cone_sines[number]) + 2e-3


def _surfaces(clusters):
    """Surface areas of the boxes times their triangles, summed: a measure of overdraw."""
    x, y, z = (clusters.aabb_max - clusters.aabb_min).T.astype(float)
    return float(((x * y + y * z + z * x) * clusters.triangles).sum())


def test_clusters_are_compact():
    """Near triangles are together: boxes are far smaller than those of as many at random."""
    corners = SCENES["none large"]
    _, clusters, _ = _built(corners)
    assert len(clusters.first) < len(corners) / MIN_TRIANGLES
    assert _surfaces(clusters) < 0.25 * _surfaces(bound_clusters(corners, clusters.first))


def test_no_cluster_reaches_from_one_heap_to_another():
    """Heaps far apart, whose triangles are mixed in the file, fewer than there are in a cluster."""
    generator = np.random.default_rng(2)
    places = 100.0 * generator.permutation(64)[:20, None] * (1.0, 0.0, 0.0)
    heap = np.repeat(np.arange(20), 30)
    corners = places[heap][:, None] + generator.uniform(-1.0, 1.0, (600, 3, 3))
    mixed = generator.permutation(600)
    _, clusters, made = _built(corners[mixed].astype(np.float32))
    assert (clusters.aabb_max - clusters.aabb_min).max() <= 2.0
    # but where triangles are as close as these, not each has a box of its own
    assert len(clusters.first) < 600 / 2
    assert len(np.unique(heap[mixed][made.order[clusters.first]])) == 20


def test_large_triangles_are_kept_apart():
    """Small ones in a box with a large one would be drawn wherever that is seen."""
    corners, clusters, _ = _built(_corners(2000, 6))
    longest = (corners.max(axis=1) - corners.min(axis=1)).max(axis=1)
    is_large = longest > 3.0  # small ones are at most 0.6 wide, of 32 in all
    has_large = np.add.reduceat(is_large.astype(int), clusters.first) > 0
    assert 3 <= is_large.sum() <= 6
    # cutting it off has to be worth it: not a full cluster each
    assert clusters.triangles[has_large].sum() < 0.7 * MAX_TRIANGLES * has_large.sum()


def test_clusters_of_large_scenes_are_larger(monkeypatch):
    corners = _corners(1000)
    small = _built(corners)[1]
    monkeypatch.setattr("omnisim.rendering.opengl.culling.clusters.LARGE_SCENE", len(corners))
    large = _built(corners)[1]
    assert len(large.first) < 0.5 * len(small.first)
    assert large.triangles.max() <= MAX_TRIANGLES


@pytest.mark.parametrize("scale", [1e-2, 1e-4])
def test_what_is_small_and_dense_in_a_large_scene_has_few_clusters(scale):
    """A plant in a city: its triangles are far smaller than the cells of the whole."""
    plant = scale * _corners(4000)
    corners, clusters, made = _built(np.concatenate((plant, 100.0 * _corners(8))))
    assert np.array_equal(np.sort(made.order), np.arange(len(corners)))
    assert len(clusters.first) <= len(corners) / MIN_TRIANGLES + 8


def test_equal_triangles_share_clusters():
    _, clusters, _ = _built(SCENES["all in one place"])
    assert len(clusters.first) == -(-150 // MAX_TRIANGLES)


def test_few_triangles_of_a_cell_share_a_cluster_wherever_others_are_dense():
    """A heap of many in one place keeps none of the rest apart."""
    heap = np.repeat(_corners(1), MAX_TRIANGLES, axis=0)
    rest = _corners(1000, seed=6)
    alone, both = (_built(one)[1] for one in (rest, np.concatenate((heap, rest))))
    assert len(both.first) <= len(alone.first) + 8
