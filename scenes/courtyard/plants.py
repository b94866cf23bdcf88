"""Trees: solid dark hearts wrapped in cards of masked leaves."""

from __future__ import annotations

import numpy as np

from scenes.courtyard.materials import in_material
from scenes.modeling.geometry import Patch, ball, bar, join, lathe, pose, sheet, tube
from scenes.modeling.stage import Model

# Parts of the foliage texture: left, bottom, width, height as fractions of the picture.
# The margins keep the opaque strips at the foot from showing along the cards' edges.
LEAFY, CONIFER = (0.02, 0.29, 0.46, 0.66), (0.52, 0.29, 0.46, 0.66)
DENSE_LEAF, DENSE_CONIFER, BARK = ((left + 0.02, 0.02, 0.29, 0.20) for left in (0.0, 0.333, 0.667))


def lemon_tree(rng: np.random.Generator) -> Model:
    """Round-headed small tree rooted at z = 0: trunk, dense heart, leafy cards around it."""
    trunk = _textured_from(BARK, tube([(0, 0, -0.1), (0.02, 0, 0.35), (-0.01, 0.01, 0.8)], 0.035))
    heart = _textured_from(DENSE_LEAF, ball(0.36, 6, 10).shifted(z=1.05))
    cards = _leaf_shell(rng, 46, np.array([0, 0, 1.05]), np.array([0.42, 0.42, 0.40]), 0.42, LEAFY)
    return Model("lemon_tree", "foliage", join([trunk, heart, *cards]))


def lemons(rng: np.random.Generator) -> Model:
    """The fruit of a lemon tree, placed like the tree."""
    fruit = ball(0.042, 4, 5)
    parts = []
    for direction in _spread_directions(rng, 9):
        center = np.array([0, 0, 1.05]) + direction * 0.50
        parts.append(in_material("lemon", fruit).shifted(*center))
    return Model("lemons", "props", join(parts))


def potted_cypress(rng: np.random.Generator) -> Model:
    """Slim clipped cypress, 1.9 m, rooted at z = 0."""
    return Model("potted_cypress", "foliage", cypress_shape(rng, 1.9, 0.26, layers=5, around=7))


def cypress_shape(
    rng: np.random.Generator, height: float, radius: float, layers: int, around: int
) -> Patch:
    """Dense cone wrapped in upright sprays."""
    t = np.array([0.06, 0.14, 0.35, 0.65, 0.97])
    profile = [(0.02, 0.05 * height)]
    profile += [(0.78 * radius * _cypress_girth(k), k * height) for k in t]
    heart = _textured_from(DENSE_CONIFER, lathe(profile, 8, 180))
    trunk = _textured_from(BARK, bar((0, 0, -0.05), (0, 0, 0.1 * height), 0.12 * radius, 6))
    parts = [heart, trunk]
    for layer in range(layers):
        low = 0.06 + 0.78 * layer / layers
        span = 2.1 * 0.78 / layers
        for index in range(around):
            yaw = 360 * (index + 0.5 * (layer % 2)) / around + rng.uniform(-9, 9)
            girth = radius * _cypress_girth(low + span / 3)
            wide = 2.5 * girth * np.sin(np.pi / around) * 1.25
            inner = 0.95 * radius * _cypress_girth(low + 0.9 * span)
            outer = 0.98 * girth
            z0, z1 = low * height, min((low + span) * height, height)
            card = np.array(
                [[[outer, -wide, z0], [outer, wide, z0]], [[inner, -wide, z1], [inner, wide, z1]]]
            )
            patch = _card(card.transpose(1, 0, 2), CONIFER)
            parts.append(patch.moved(pose(yaw_deg=yaw)))
    return join(parts)


def olive_shape(rng: np.random.Generator, height: float, spread: float, cards: int) -> Patch:
    """Broad tree for the country outside."""
    middle = np.array([0, 0, 0.66 * height])
    reach = np.array([spread, spread, 0.36 * height])
    trunk = _textured_from(BARK, bar((0, 0, -0.2), (0, 0, 0.5 * height), 0.07 * height, 6))
    heart = ball(1.0, 4, 7).moved(pose(*middle, scale=0.78 * reach))
    return join(
        [
            trunk,
            _textured_from(DENSE_LEAF, heart),
            *_leaf_shell(rng, cards, middle, 0.9 * reach, 1.0 * spread, LEAFY),
        ]
    )


def _leaf_shell(
    rng: np.random.Generator,
    count: int,
    middle: np.ndarray,
    reach: np.ndarray,
    size: float,
    region: tuple[float, float, float, float],
) -> list[Patch]:
    """Leafy cards over an ellipsoid, lit as the ellipsoid itself would be."""
    cards = []
    for direction in _spread_directions(rng, count):
        facing = direction + rng.normal(0, 0.28, 3)
        facing /= np.linalg.norm(facing)
        side = np.cross([0, 0, 1.0], facing)
        side /= np.linalg.norm(side)
        spin = rng.uniform(0, 2 * np.pi)
        right = np.cos(spin) * side + np.sin(spin) * np.cross(facing, side)
        up = np.cross(facing, right)
        at = middle + direction * reach
        half = size * rng.uniform(0.42, 0.58)
        points = np.array(
            [[at + half * (a * right + 1.4 * b * up) for b in (-1, 1)] for a in (-1, 1)]
        )
        card = _card(points, region)
        normals = card.normals * 0.35 + direction * 0.65
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        cards.append(Patch(card.positions, normals, card.uvs, card.faces))
    return cards


def _card(points: np.ndarray, region: tuple[float, float, float, float]) -> Patch:
    """Quad (2 across, 2 up, 3) showing a region of the foliage texture."""
    left, bottom, width, height = region
    uvs = np.array(
        [
            [[left, bottom], [left, bottom + height]],
            [[left + width, bottom], [left + width, bottom + height]],
        ]
    )
    return sheet(points, uvs)


def _textured_from(region: tuple[float, float, float, float], patch: Patch) -> Patch:
    """Stretch a region of the foliage texture over a part."""
    low, high = patch.uvs.min(axis=0), patch.uvs.max(axis=0)
    unit = (patch.uvs - low) / np.maximum(high - low, 1e-6)
    uvs = np.array(region[:2]) + unit * np.array(region[2:])
    return Patch(patch.positions, patch.normals, uvs, patch.faces)


def _spread_directions(rng: np.random.Generator, count: int) -> np.ndarray:
    """Evenly spread unit vectors (golden spiral), slightly shaken."""
    index = np.arange(count) + 0.5
    z = 1 - 2 * index / count
    angle = np.pi * (1 + 5**0.5) * index
    flat = np.sqrt(1 - z**2)
    vectors = np.stack([flat * np.cos(angle), flat * np.sin(angle), z], axis=1)
    vectors += rng.normal(0, 0.08, vectors.shape)
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


def _cypress_girth(t: float) -> float:
    """Relative radius of a cypress at a relative height."""
    return float(np.clip(np.sin(np.pi * np.clip(t, 0, 1) ** 0.62) ** 0.75, 0.02, 1))
