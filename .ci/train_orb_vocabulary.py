"""Vocabulary of ORB descriptors for ORB-SLAM3's place recognition, trained on rendered images.

    python .ci/train_orb_vocabulary.py omnisim/evaluation/estimators/orb_vocabulary.txt.gz

renders fisheye images of three built-in scenes, and trains the vocabulary on them.
The file has DBoW2's text format. The first line has branching factor, depth, scoring and weighting.
Each further line has a node: its parent (0: the root), 1 for a word, the 32 bytes of its
descriptor, and its weight.

Source: Gálvez-López & Tardós, "Bags of binary words for fast place recognition in image sequences",
T-RO 2012.
"""

from __future__ import annotations

import gzip
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from omnisim.cameras import KannalaBrandtCamera
from omnisim.core.errors import EstimatorError
from omnisim.core.extras import require_extra
from omnisim.core.poses import pose
from omnisim.evaluation.estimators.orb_slam3 import gray
from omnisim.rendering.camera.omnicamera import OmniCamera

BRANCHING, DEPTH = 6, 5
SCORING, WEIGHTING = 0, 0  # L1 norm; term frequency and inverse document frequency
MAX_ITERATIONS = 12
# Training images of the built-in vocabulary: number per scene, half width of the square of
# positions around the origin, and size and field of view of the fisheye.
SCENES, IMAGES, HALF_WIDTH_M = ("soccer", "courtyard", "mapping"), 40, 2.0
SIZE_PX, THETA_MAX_DEG, FEATURES = 400, 80.0, 600
Bits = NDArray[np.bool_]


class Node(NamedTuple):
    """Node of a vocabulary tree.

    Attributes:
        parent: number of the parent node, from 1; 0: the root.
        is_word: the node has no children.
        bits: (256,) descriptor.
        weight: weight of a word; 0.0 for inner nodes.
    """

    parent: int
    is_word: bool
    bits: Bits
    weight: float


def train_vocabulary(
    images: Sequence[Bits], branching: int = BRANCHING, depth: int = DEPTH, seed: int = 0
) -> list[Node]:
    """Cluster descriptors into a tree, level by level.

    Args:
        images: descriptors (n, 256) of each image, as bits.
        branching: children per node.
        depth: levels below the root.
        seed: seed of the initial cluster centers.

    Raises:
        EstimatorError: fewer descriptors than children of the root.
    """
    bits = np.concatenate(images)
    if len(bits) < branching:
        raise EstimatorError(f"{len(bits)} descriptors: expected at least {branching}")
    owners = np.repeat(np.arange(len(images)), [len(one) for one in images])
    generator = np.random.default_rng(seed)
    nodes: list[Node] = []
    level = [(0, np.arange(len(bits)))]
    for floor in range(1, depth + 1):
        below = []
        for parent, members in level:
            centers, nearest = _clusters(bits[members], branching, generator)
            for number, center in enumerate(centers):
                own = members[nearest == number]
                is_word = floor == depth or len(own) <= branching
                known_in = len(np.unique(owners[own]))
                weight = float(np.log(len(images) / known_in)) if is_word else 0.0
                nodes.append(Node(parent, is_word, center, weight))
                if not is_word:
                    below.append((len(nodes), own))
        level = below
    return nodes


def _clusters(
    bits: Bits, count: int, generator: np.random.Generator
) -> tuple[Bits, NDArray[np.intp]]:
    """Centers (k, 256) of at most `count` nonempty clusters, and the clusters (n,) of all bits."""
    signs = np.where(bits, 1.0, -1.0).astype(np.float32)
    centers = np.unique(bits[generator.permutation(len(bits))[:count]], axis=0)
    nearest = np.zeros(len(bits), dtype=np.intp)
    for _ in range(MAX_ITERATIONS):
        # Hamming distance is 128 minus half the product of signs.
        nearest = np.argmax(signs @ np.where(centers, 1.0, -1.0).astype(np.float32).T, axis=1)
        used, nearest = np.unique(nearest, return_inverse=True)
        majority = np.stack([signs[nearest == one].sum(axis=0) > 0.0 for one in range(len(used))])
        if np.array_equal(majority, centers):
            break
        centers = majority
    return centers, nearest


def vocabulary_text(nodes: Sequence[Node], branching: int = BRANCHING, depth: int = DEPTH) -> str:
    """Text of a vocabulary, without a final newline: DBoW2 would read a node after it."""
    lines = [f"{branching} {depth} {SCORING} {WEIGHTING}"]
    for node in nodes:
        numbers = " ".join(map(str, np.packbits(node.bits)))
        lines.append(f"{node.parent} {int(node.is_word)} {numbers} {node.weight:.6g}")
    return "\n".join(lines)


def descriptors(gray: NDArray[np.uint8], count: int = FEATURES) -> Bits:
    """ORB descriptors (n, 256) of an image, as bits."""
    import cv2

    found = cv2.ORB.create(count).detectAndCompute(gray, None)[1]
    if found is None:
        return np.empty((0, 256), dtype=np.bool_)
    return np.unpackbits(np.asarray(found, dtype=np.uint8), axis=1).astype(np.bool_)


def training_images(
    scenes: Sequence[str] = SCENES, count: int = IMAGES, size_px: int = SIZE_PX
) -> Iterator[NDArray[np.uint8]]:
    """Gray fisheye images (height, width) of scenes, from random poses above the ground."""
    from omnisim.rendering.stage import open_sensor

    theta_rad, middle_px = np.radians(THETA_MAX_DEG), 0.5 * (size_px - 1)
    focal_px = 0.5 * size_px / theta_rad
    lens = KannalaBrandtCamera(
        *(size_px, size_px), (focal_px, focal_px), (middle_px, middle_px), (0.0,) * 4, theta_rad
    )
    generator = np.random.default_rng(0)
    for scene in scenes:
        with open_sensor(scene, OmniCamera(lens)) as renderer:
            for _ in range(count):
                x_m, y_m = generator.uniform(-HALF_WIDTH_M, HALF_WIDTH_M, 2)
                z_m, yaw_deg = generator.uniform(0.4, 1.6), generator.uniform(0.0, 360.0)
                world_from_base = pose((x_m, y_m, z_m), yaw_deg=yaw_deg)
                yield gray(renderer.render(world_from_base).rgba[..., :3])


def main(path: Path) -> None:
    """Render the images, train a vocabulary, and write it to a file."""
    require_extra("measure", "a vocabulary", EstimatorError)
    nodes = train_vocabulary([descriptors(image) for image in training_images()])
    packed = gzip.compress(vocabulary_text(nodes).encode(), 9, mtime=0)
    path.write_bytes(packed)
    words = sum(node.is_word for node in nodes)
    print(f"{path}: {words} words, {len(nodes)} nodes, {len(packed) / 1024:.0f} KiB")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
