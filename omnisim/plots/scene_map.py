"""Floor plan of a scene: a section at some height, with everything below in color."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from numpy.typing import NDArray

from omnisim.core.srgb import linear_from_srgb, srgb_from_linear
from omnisim.scene import Scene
from omnisim.scene.model import AlphaMode, Material, Mesh

CUT_M = 0.9
_WALL = "#333333"
_PALE = 0.45  # share of white, for lines and points on top


def draw_scene_map(
    axes: Axes,
    scene: Scene,
    low_m: NDArray[np.float64],
    high_m: NDArray[np.float64],
    ground_m: float = 0.0,
) -> None:
    """Draw the scene between two corners (2,) of the ground, x to the right and y up.

    Args:
        axes: axes to draw on.
        scene: scene to draw.
        low_m, high_m: corners of the drawn part.
        ground_m: height of the ground; the section is `CUT_M` above it.
    """
    cut_m = ground_m + CUT_M
    if not scene.instances:  # everything moves
        scene = scene.at_start()
    shown, heights, colors, walls = [], [], [], []
    for instance in scene.instances:
        mesh = scene.meshes[instance.mesh]
        material = scene.materials[mesh.material]
        matrix = instance.world_from_mesh
        corners = mesh.positions.astype(np.float64) @ matrix[:3, :3].T + matrix[:3, 3]
        triangles = corners[mesh.triangles]
        near = np.all(triangles[..., :2].min(axis=1) <= high_m, axis=1)
        near &= np.all(triangles[..., :2].max(axis=1) >= low_m, axis=1)
        triangles = triangles[near]
        z = triangles[..., 2]
        below = z.max(axis=1) < cut_m
        below &= np.abs(_areas(triangles)) > 1e-8
        shown.append(triangles[below, :, :2])
        heights.append(z[below].mean(axis=1))
        colors.append(np.tile(_mean_color(material, mesh), (int(below.sum()), 1)))
        if material.alpha_mode is not AlphaMode.BLEND:
            walls.append(
                _cross_sections(triangles[(z.min(axis=1) < cut_m) & (z.max(axis=1) > cut_m)], cut_m)
            )
    order = np.argsort(np.concatenate(heights), kind="stable")
    faces = np.concatenate(colors)[order]
    # edges in the same color hide hairlines of background between triangles
    axes.add_collection(
        PolyCollection(
            list(np.concatenate(shown)[order]), facecolors=faces, edgecolors=faces, linewidths=0.3
        )
    )
    axes.add_collection(LineCollection(list(np.concatenate(walls)), colors=_WALL, linewidths=0.8))


def _areas(triangles: NDArray[np.float64]) -> NDArray[np.float64]:
    """Twice the signed areas (n,) of triangles (n, 3, 3), seen from above."""
    first, second = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    return first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]


def _mean_color(material: Material, mesh: Mesh) -> NDArray[np.float64]:
    """Mean color of a surface, lightened: sRGB (3,)."""
    color = np.array(material.base_color[:3])
    if material.texture is not None:
        sample = material.texture.pixels[::4, ::4, :3] / 255.0
        color = color * linear_from_srgb(sample).reshape(-1, 3).mean(axis=0)
    if mesh.colors is not None:
        color = color * mesh.colors[:, :3].mean(axis=0)
    return _PALE + (1.0 - _PALE) * srgb_from_linear(color)


def _cross_sections(triangles: NDArray[np.float64], cut_m: float) -> NDArray[np.float64]:
    """Line segments (n, 2, 2) in which triangles (n, 3, 3) intersect the plane z = `cut_m`.

    Each triangle must have corners on both sides of the plane.
    """
    z = triangles[..., 2] - cut_m
    # the corner alone on its side, and the two others
    above = z > 0.0
    alone = np.where(above.sum(axis=1) == 1, above.argmax(axis=1), (~above).argmax(axis=1))
    rows = np.arange(len(triangles))
    ends = []
    for step in (1, 2):
        other = (alone + step) % 3
        share = z[rows, alone] / (z[rows, alone] - z[rows, other])
        start, end = triangles[rows, alone, :2], triangles[rows, other, :2]
        ends.append(start + share[:, None] * (end - start))
    return np.stack(ends, axis=1).reshape(-1, 2, 2)
