"""Clusters of triangles beside brute force: every triangle, in its box and in its cone."""

import itertools

import numpy as np
import pytest

from omnisim.gpu.culling.clusters import CHUNK, FEW_TRIANGLES, GROUP, chunks_of, cut


def _corners(count, large=0, seed=5):
    """Random triangles (count, 3, 3), some of them as large as all of the rest."""
    generator = np.random.default_rng(seed)
    centres = generator.uniform(-8.0, 8.0, (count, 1, 3))
    sizes = np.where(np.arange(count) < large, 8.0, 0.3)[:, None, None]
    corners = centres + sizes * generator.uniform(-1.0, 1.0, (count, 3, 3))
    return generator.permutation(corners).astype(np.float32)


def _sphere():
    """Triangles (n, 3, 3) of a unit sphere: chunks of it are narrow cones."""
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
    "one chunk": _corners(CHUNK),
    "one more than a chunk": _corners(CHUNK + 1),
    "one triangle": _corners(1),
    "all in one place": np.repeat(_corners(1), 150, axis=0),
    "a sphere": _sphere(),
}
scenes = pytest.mark.parametrize("corners", SCENES.values(), ids=SCENES.keys())


def _looks(corners, count=3, seed=7):
    """Looks (n,) of triangles at random, some of which nothing has."""
    return np.random.default_rng(seed).integers(0, count, len(corners)) * 2


def _cut(corners, looks=None):
    made = cut(corners, np.zeros(len(corners), dtype=int) if looks is None else looks)
    return corners[made.order], made.chunks, made


@scenes
def test_every_triangle_is_in_one_chunk_of_one_look(corners):
    looks = _looks(corners)
    _, chunks, made = _cut(corners, looks)
    assert np.array_equal(np.sort(made.order), np.arange(len(corners)))
    assert chunks.first[0] == 0
    assert np.array_equal(chunks.first[1:], np.cumsum(chunks.count)[:-1])
    assert chunks.count.sum() == len(corners)
    assert chunks.count.min() >= 1
    assert chunks.count.max() <= CHUNK
    own = looks[made.order]
    assert np.array_equal(own, np.repeat(own[chunks.first], chunks.count))


@scenes
def test_every_piece_is_in_one_group_which_is_around_it(corners):
    _, chunks, made = _cut(corners, _looks(corners))
    assert made.groups
    triangles = chunks.count
    for below, groups in itertools.pairwise((chunks, *made.groups)):
        assert groups.first[0] == 0
        assert np.array_equal(groups.first[1:], np.cumsum(groups.count)[:-1])
        assert groups.count.sum() == len(below.first)
        assert groups.count.max() <= GROUP
        for number, (first, count) in enumerate(zip(groups.first, groups.count, strict=True)):
            own = slice(first, first + count)
            assert np.array_equal(groups.lows[number], below.lows[own].min(axis=0))
            assert np.array_equal(groups.highs[number], below.highs[own].max(axis=0))
            assert groups.widths[number] == below.widths[own].max()
            assert groups.triangles[number] == triangles[own].sum()
        triangles = groups.triangles


@scenes
def test_boxes_are_around_their_triangles_and_cones_around_their_normals(corners):
    corners, chunks, _ = _cut(corners)
    exact = corners.astype(np.float64)
    normals = np.cross(exact[:, 1] - exact[:, 0], exact[:, 2] - exact[:, 0])
    lengths = np.linalg.norm(normals, axis=1)
    for number, (first, count) in enumerate(zip(chunks.first, chunks.count, strict=True)):
        own = slice(first, first + count)
        assert np.array_equal(chunks.lows[number], corners[own].min(axis=(0, 1)))
        assert np.array_equal(chunks.highs[number], corners[own].max(axis=(0, 1)))
        width = np.sqrt(0.5 * lengths[own].mean())  # of squares: the mean triangle's side
        few = min(FEW_TRIANGLES / count, 1.0)
        assert chunks.widths[number] == pytest.approx(width * few**0.25, rel=1e-4)
        has_area = lengths[own] > 1e-9
        units = normals[own][has_area] / lengths[own][has_area, None]
        cosines = units @ chunks.axes[number].astype(np.float64)
        # the cone's opening is a sine of float32, whose last digits are worth up to this angle
        if chunks.spreads[number] <= 1.0:
            angles = np.arccos(np.clip(cosines, -1.0, 1.0))
            assert angles.max() <= np.arcsin(chunks.spreads[number]) + 2e-3


def _surfaces(chunks):
    """Of the boxes, times their triangles, all in all: about what is drawn for nothing."""
    x, y, z = (chunks.highs - chunks.lows).T.astype(float)
    return float(((x * y + y * z + z * x) * chunks.count).sum())


def test_chunks_are_compact():
    """Near triangles are together: boxes are far smaller than those of as many at random."""
    corners = SCENES["none large"]
    _, chunks, _ = _cut(corners)
    assert len(chunks.first) < len(corners) / FEW_TRIANGLES
    assert _surfaces(chunks) < 0.25 * _surfaces(chunks_of(corners, chunks.first))


def test_no_chunk_reaches_from_one_heap_to_another():
    """Heaps far apart, whose triangles are mixed in the file, fewer than there are in a chunk."""
    generator = np.random.default_rng(2)
    places = 100.0 * generator.permutation(64)[:20, None] * (1.0, 0.0, 0.0)
    heap = np.repeat(np.arange(20), 30)
    corners = places[heap][:, None] + generator.uniform(-1.0, 1.0, (600, 3, 3))
    mixed = generator.permutation(600)
    _, chunks, made = _cut(corners[mixed].astype(np.float32))
    assert (chunks.highs - chunks.lows).max() <= 2.0
    # but where triangles are as close as these, not each has a box of its own
    assert len(chunks.first) < 600 / 2
    assert len(np.unique(heap[mixed][made.order[chunks.first]])) == 20


def test_large_triangles_are_kept_apart():
    """Small ones in a box with a large one would be drawn wherever that is seen."""
    corners, chunks, _ = _cut(_corners(2000, 6))
    longest = (corners.max(axis=1) - corners.min(axis=1)).max(axis=1)
    is_large = longest > 3.0  # small ones are at most 0.6 wide, of 32 in all
    has_large = np.add.reduceat(is_large.astype(int), chunks.first) > 0
    assert 3 <= is_large.sum() <= 6
    # cutting it off has to be worth it: not a full chunk each
    assert chunks.count[has_large].sum() < 0.7 * CHUNK * has_large.sum()
