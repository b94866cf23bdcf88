"""What is hidden, beside brute force over every texel."""

import numpy as np
import pytest

from omnisim.gpu.face_drawing import projection
from omnisim.gpu.face_plan import Face
from omnisim.gpu.occlusion import CoarseDepth, Outlines, outlines


def _depth(generator, height, width):
    """Smooth hills of depth, with a few holes to infinity and near posts."""
    y, x = np.mgrid[:height, :width] / 16.0
    depth = 0.3 + 0.1 * np.sin(x + generator.uniform(0.0, 6.0)) * np.cos(y)
    depth[generator.random(depth.shape) < 1e-3] = 0.0
    depth[generator.random(depth.shape) < 1e-2] = 0.9
    return depth.astype(np.float32)


def _boxes(generator, height, width, count):
    size = np.array([width, height])
    first = generator.integers(0, size, (count, 2))
    # from a texel to the whole picture, small ones mostly
    reach = (size * generator.random((count, 2)) ** 4).astype(int)
    last = np.minimum(first + reach, size - 1)
    return Outlines(first, last, generator.uniform(0.0, 0.5, count).astype(np.float32))


@pytest.mark.parametrize("shape", [(64, 96), (61, 83), (130, 7), (5, 200), (3, 3), (1, 1)])
def test_nothing_is_hidden_where_a_texel_is_farther(shape):
    generator = np.random.default_rng(shape)
    hidden_of, truth_of = [], []
    for _ in range(3):
        depth = _depth(generator, *shape)
        boxes = _boxes(generator, *shape, 400)
        hidden_of.append(CoarseDepth(depth).hides(boxes))
        truth_of.append(
            [
                depth[top : bottom + 1, left : right + 1].min() > nearest
                for (left, top), (right, bottom), nearest in zip(*boxes, strict=True)
            ]
        )
    hidden, truth = np.concatenate(hidden_of), np.concatenate(truth_of)
    assert not np.any(hidden & ~truth)
    if min(shape) >= 60:
        # coarse cells reach past a box's edges, and holes are everywhere
        assert hidden.sum() > 0.5 * truth.sum()


def test_what_is_in_front_of_everything_or_nowhere_near_is_not_hidden():
    coarse = CoarseDepth(np.full((40, 40), 0.25, dtype=np.float32))
    first, last = np.tile([[4, 4]], (4, 1)), np.tile([[20, 30]], (4, 1))
    nearest = np.array([0.2, 0.25, 0.3, np.inf], dtype=np.float32)
    assert coarse.hides(Outlines(first, last, nearest)).tolist() == [True, False, False, False]


def _tile(left_px=40, top_px=24):
    return Face(0, 200, (-6, 30), (120, 90), left_px=left_px, top_px=top_px)


@pytest.mark.parametrize("far_m", [np.inf, 30.0])
def test_outlines_cover_all_that_boxes_do(far_m):
    """Points of random boxes, projected in float64, are in the outline, and no nearer."""
    generator = np.random.default_rng(11)
    face, near_m, count = _tile(), 0.05, 500
    clip_from_face = projection(face, near_m, far_m)
    middles = generator.uniform((-3.0, -3.0, -1.0), (3.0, 3.0, 6.0), (count, 3))
    halves = generator.uniform(0.0, 0.6, (count, 3)) * generator.random((count, 1))
    signs = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    corners = (middles[:, None] + signs * halves[:, None]).astype(np.float32)
    tiles = np.tile((face.left_px, face.top_px, *face.tile_px), (count, 1))
    boxes = outlines(corners, np.repeat(clip_from_face[None], count, axis=0), tiles)
    assert np.all(boxes.first >= (face.left_px, face.top_px))
    assert np.all(boxes.last < (face.left_px + face.tile_px[0], face.top_px + face.tile_px[1]))

    inside = generator.uniform(-1.0, 1.0, (count, 200, 3))
    points = middles[:, None] + inside * halves[:, None]
    points[:, :8] = corners
    x, y, z, w = np.moveaxis(points @ clip_from_face[:, :3].T + clip_from_face[:, 3], -1, 0)
    drawn = (w > 0.0) & (z <= w) & (z >= 0.0) & (np.abs(x) <= w) & (np.abs(y) <= w)
    assert 0.05 < drawn.mean() < 0.5
    w = np.where(drawn, w, 1.0)
    size = np.array(face.tile_px) - 1e-9  # the right edge is not in the tile
    texel = np.floor(0.5 * (np.stack((x, y), axis=-1) / w[..., None] + 1.0) * size)
    texel += (face.left_px, face.top_px)
    covered = (texel >= boxes.first[:, None]) & (texel <= boxes.last[:, None])
    assert np.all(covered.all(axis=-1)[drawn])
    # float32: matrices and corners are rounded; `hides` allows for a hundred times as much
    nearest = np.broadcast_to(boxes.nearest[:, None].astype(np.float64), z.shape)
    assert np.all((z / w)[drawn] <= nearest[drawn] * (1.0 + 1e-6) + 1e-9)
    # boxes before the viewpoint are not taken for the whole tile
    is_small = (boxes.last - boxes.first).max(axis=1) < 60
    assert is_small[drawn.any(axis=1)].mean() > 0.4
