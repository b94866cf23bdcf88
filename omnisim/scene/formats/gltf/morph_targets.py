"""Morph targets of a primitive, and their weights."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from omnisim.scene.formats.gltf.json_object import JsonObject
from omnisim.scene.formats.gltf.primitives import Primitive
from omnisim.scene.motion.deformation import MorphTargets
from omnisim.scene.motion.keyframes import Keyframes

Matrix = NDArray[np.float64]


class MorphedVertices(NamedTuple):
    """Vertices of a primitive before skinning.

    Attributes:
        positions: (n, 3), morphed by static weights.
        normals: (n, 3), morphed by static weights; None: no normals.
        targets: targets with animated weights; None: no animated weights.
    """

    positions: Matrix
    normals: Matrix | None
    targets: MorphTargets | None


def resting_weights(node: JsonObject, mesh: JsonObject) -> tuple[float, ...]:
    """Static weights of a node's morph targets: the node's, or else its mesh's."""
    holder = node if node.has("weights") else mesh
    return holder.numbers("weights", len(holder.array("weights"))) or ()


def morph(
    primitive: Primitive,
    weights: tuple[float, ...],
    animated: Keyframes | None,
    period_s: float,
) -> MorphedVertices:
    """Morph a primitive by static weights, or set up targets with animated ones."""
    positions, normals = primitive.required("POSITION", 3), primitive.attribute("NORMAL")
    if normals is not None and normals.shape != positions.shape:
        normals = None
    count = len(primitive.targets)
    if animated is not None and animated.is_constant:
        weights, animated = tuple(animated.values[0].tolist()), None
    values = np.zeros(count)
    values[: len(weights)] = weights[:count]
    if animated is not None:
        values = np.abs(animated.values[:, :count]).max(axis=0)
        for tangents in (animated.in_tangents, animated.out_tangents):
            if tangents is not None:
                values = np.maximum(values, np.abs(tangents[:, :count]).max(axis=0))
    used = np.flatnonzero(values)
    if not len(used):
        return MorphedVertices(positions, normals, None)
    offsets = primitive.offsets("POSITION", used, len(positions))
    normal_offsets = primitive.offsets("NORMAL", used, len(positions))
    if offsets is None:
        offsets = np.zeros((len(used), *positions.shape))
    if animated is None:
        positions = positions + np.einsum("t,tnc->nc", values[used], offsets)
        if normals is not None and normal_offsets is not None:
            normals = normals + np.einsum("t,tnc->nc", values[used], normal_offsets)
        return MorphedVertices(positions, normals, None)
    targets = MorphTargets(
        offsets.astype(np.float32),
        None if normal_offsets is None else normal_offsets.astype(np.float32),
        _columns(animated, used),
        period_s,
    )
    return MorphedVertices(positions, normals, targets)


def _columns(keyframes: Keyframes, columns: NDArray[np.intp]) -> Keyframes:
    """Keyframes with a subset of the value columns."""
    before, after = keyframes.in_tangents, keyframes.out_tangents
    return replace(
        keyframes,
        values=keyframes.values[:, columns],
        in_tangents=None if before is None else before[:, columns],
        out_tangents=None if after is None else after[:, columns],
    )
