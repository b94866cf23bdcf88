"""Edges of shadows in two images, and their distance."""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from omnisim.scene.model import Light, Material, Scene

_HALF, _FINER = 0.5, 8
_MARGIN_PX = 2  # around the edges of objects, which are not edges of shadows
_GRAY = (0.5, 0.5, 0.5, 1.0)
_DARKEST = 0.02  # of white, in full light: noise hides darker shadows


def lit_share(image: NDArray[np.float32], unshadowed: NDArray[np.float32]) -> NDArray[np.float32]:
    """Share (height, width) of a lamp's light that reaches surfaces.

    Args:
        image, unshadowed: linear images (height, width, 3) with and without shadows.
    """
    light, full = image.sum(axis=-1), unshadowed.sum(axis=-1)
    share: NDArray[np.float32] = np.clip(light / np.maximum(full, 3.0 * _DARKEST), 0.0, 1.0)
    return share


def inside_surfaces(
    instances: NDArray[np.integer], normals: NDArray[np.floating], unshadowed: NDArray[np.float32]
) -> NDArray[np.bool_]:
    """Mask (height, width) of pixels away from edges of objects, and bright without shadows.

    Args:
        instances: (height, width) instance IDs.
        normals: (height, width, 3) unit normals.
        unshadowed: (height, width, 3) linear image without shadows.
    """
    breaks = np.zeros(instances.shape, bool)
    for axis in (0, 1):
        other = np.roll(instances, 1, axis) != instances
        other |= (np.roll(normals, 1, axis) * normals).sum(axis=-1) < 0.9  # 26°
        breaks |= other | np.roll(other, -1, axis)
    breaks = ndimage.binary_dilation(breaks, iterations=_MARGIN_PX)
    return np.asarray(~breaks & (unshadowed.mean(axis=-1) > _DARKEST), bool)


def edge_distance_px(
    one: NDArray[np.float32], other: NDArray[np.float32], where: NDArray[np.bool_]
) -> float:
    """Mean distance in px from each edge, in either image, to the nearest edge in the other.

    An edge is where half of the light arrives, linearly interpolated between pixels.

    Args:
        one, other: (height, width) shares of light.
        where: (height, width) pixels with relevant edges; the result is NaN without edges.
    """
    finer = [_edges(values) for values in (one, other)]
    counted = ndimage.zoom(where, _FINER, order=0, grid_mode=True, mode="nearest")
    distances = []
    for edges, other_edges in (finer, finer[::-1]):
        away = ndimage.distance_transform_edt(~other_edges)
        distances.append(away[edges & counted] / _FINER)
    nearest_px = np.concatenate(distances)
    return float(nearest_px.mean()) if len(nearest_px) else float("nan")


def _edges(values: NDArray[np.float32]) -> NDArray[np.bool_]:
    """Mask of the edges in an image of light shares, at `_FINER` times the resolution."""
    is_lit = ndimage.zoom(values, _FINER, order=1, grid_mode=True, mode="nearest") > _HALF
    edges = np.zeros(is_lit.shape, bool)
    edges[1:] |= is_lit[1:] != is_lit[:-1]
    edges[:, 1:] |= is_lit[:, 1:] != is_lit[:, :-1]
    return edges


def gray_in_one_light(scene: Scene, light: Light) -> Scene:
    """Copy of the scene with plain gray surfaces, lit by one lamp."""
    return dataclasses.replace(
        scene,
        meshes=tuple(dataclasses.replace(one, colors=None) for one in scene.meshes),
        materials=tuple(
            Material(one.name, _GRAY, double_sided=one.double_sided) for one in scene.materials
        ),
        lighting=dataclasses.replace(scene.lighting, lights=(light,)),
    )
