"""Chunks of triangles beside brute force: every triangle, in its box and in its cone."""

import numpy as np
import pytest

from omnisim.gpu.chunks import CHUNK, chunks_of, compact_order


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


def _cut(corners):
    order, first = compact_order(corners)
    return corners[order], chunks_of(corners[order], first), order


@scenes
def test_every_triangle_is_in_one_chunk(corners):
    _, chunks, order = _cut(corners)
    assert np.array_equal(np.sort(order), np.arange(len(corners)))
    assert chunks.first[0] == 0
    assert np.array_equal(chunks.first[1:], np.cumsum(chunks.count)[:-1])
    assert chunks.count.sum() == len(corners)
    assert chunks.count.min() >= 1
    assert chunks.count.max() <= CHUNK


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
        area = np.sqrt(0.5 * lengths[own].mean())  # of squares: the mean triangle's side
        assert chunks.widths[number] == pytest.approx(area, rel=1e-4)
        has_area = lengths[own] > 1e-9
        units = normals[own][has_area] / lengths[own][has_area, None]
        cosines = units @ chunks.axes[number].astype(np.float64)
        # the cone's opening is a sine of float32, whose last digits are worth up to this angle
        if chunks.spreads[number] <= 1.0:
            angles = np.arccos(np.clip(cosines, -1.0, 1.0))
            assert angles.max() <= np.arcsin(chunks.spreads[number]) + 2e-3


def test_chunks_are_compact():
    """Near triangles are together: boxes are far smaller than those of as many at random."""
    _, chunks, _ = _cut(SCENES["none large"])
    mixed = chunks_of(SCENES["none large"], chunks.first)
    sizes, at_random = (np.prod(one.highs - one.lows, axis=1).sum() for one in (chunks, mixed))
    assert sizes < 0.25 * at_random


def test_large_triangles_are_kept_apart():
    corners, chunks, _ = _cut(SCENES["some large"])
    longest = (corners.max(axis=1) - corners.min(axis=1)).max(axis=1)
    is_large = longest > 3.0  # small ones are at most 0.6 wide, of 32 in all
    shares = np.add.reduceat(is_large.astype(int), chunks.first) / chunks.count
    assert np.all(shares[shares < 0.5] == 0.0)
    assert np.count_nonzero(shares) == np.ceil(70 / CHUNK)
