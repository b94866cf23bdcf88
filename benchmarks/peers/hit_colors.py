"""Colors at ray hits: base color, texture and light, in NumPy.

Surfaces and lights are those of `shaders/scene/surface.frag` and `shaders/scene/lighting.glsl`.
Textures differ: lookups use four texels of the finest level at any distance. `matmul` is avoided,
because BLAS would use threads, and the race is on one thread.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from omnisim.core.srgb import linear_from_srgb
from omnisim.rendering.rays.geometry import build_geometry
from omnisim.scene.model import AlphaMode, LightKind, Material, Scene, Texture, Wrap

Floats = NDArray[np.float32]


class HitColors:
    """Colors of points on a scene's triangles; tables are built once."""

    def __init__(self, scene: Scene):
        geometry = build_geometry(scene)
        self._lighting = scene.lighting
        corners_m = geometry.positions_m[geometry.corners].astype(np.float32)
        self._flat = np.cross(corners_m[:, 1] - corners_m[:, 0], corners_m[:, 2] - corners_m[:, 0])
        self._normals = geometry.normals[geometry.corners]
        self._coordinates = geometry.texture_coordinates[geometry.corners]
        self._colors = None if geometry.colors is None else geometry.colors[geometry.corners]
        self._table = _TextureTable(scene.materials)
        of_surface = np.array(
            [scene.meshes[instance.mesh].material for instance in scene.instances]
        )
        textured = np.array([surface.is_textured for surface in geometry.surfaces])
        self._material = of_surface[geometry.surface_of_triangle]
        # the last texture is white
        self._texture = np.where(
            textured[geometry.surface_of_triangle], self._material, len(scene.materials)
        )
        materials = scene.materials
        self._base = np.array([material.base_color for material in materials], dtype=np.float32)
        emissive = np.array([material.emissive for material in materials], dtype=np.float32)
        self._base[:, :3] += emissive  # emissive materials are otherwise black, or screens
        self._two_sided = np.array([material.double_sided for material in materials])
        self._unlit = np.array([material.unlit for material in materials]) | emissive.any(axis=1)
        modes = [material.alpha_mode for material in materials]
        self._blended = np.array([mode is AlphaMode.BLEND for mode in modes])
        self._cutoff = np.array(
            [
                material.alpha_cutoff if material.alpha_mode is AlphaMode.MASK else -1.0
                for material in materials
            ],
            dtype=np.float32,
        )

    def of(
        self,
        triangles: NDArray[np.int32],
        u: Floats,
        v: Floats,
        points_m: Floats,
        directions: Floats,
    ) -> tuple[Floats, Floats]:
        """Linear RGB (n, 3) and opacity (n, 1) at hits.

        Args:
            triangles: (n,) indices of the triangles.
            u, v: (n,) barycentric coordinates of the second and third corners.
            points_m, directions: (n, 3) hit points and ray directions, world.
        """
        weights = np.stack((1.0 - u - v, u, v), axis=1)

        def interpolated(corners: Floats) -> Floats:
            values: Floats = np.einsum("nk,nkc->nc", weights, corners[triangles])
            return values

        material = self._material[triangles]
        color = self._base[material] * self._table.lookup(
            self._texture[triangles], interpolated(self._coordinates)
        )
        if self._colors is not None:
            color *= interpolated(self._colors)
        flat = self._flat[triangles]
        is_back = np.einsum("ij,ij->i", flat, directions) > 0.0
        opacity = np.where(self._blended[material], color[:, 3], np.float32(1.0))
        opacity[color[:, 3] < self._cutoff[material]] = 0.0
        opacity[is_back & ~self._two_sided[material]] = 0.0

        flat = np.where(is_back[:, None], -flat, flat)
        normal = interpolated(self._normals)
        is_flat = ~normal.any(axis=1)
        normal[is_flat] = flat[is_flat]
        normal *= np.where(np.einsum("ij,ij->i", normal, flat) < 0.0, -1.0, 1.0)[:, None]
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-20)
        light = self._light(points_m, normal.astype(np.float32))
        light[self._unlit[material]] = 1.0
        return color[:, :3] * light, opacity[:, None].astype(np.float32)

    def _light(self, points_m: Floats, normals: Floats) -> Floats:
        """Light (n, 3) reflected by a white surface."""
        lighting = self._lighting
        total = np.empty_like(normals)
        total[:] = lighting.ambient
        for light in lighting.lights:
            intensity = np.float32(light.intensity * lighting.exposure)
            color = intensity * np.array(light.color, dtype=np.float32)
            axis = light.direction.astype(np.float32)
            if light.kind is LightKind.DIRECTIONAL:
                level = np.maximum(-np.einsum("ij,j->i", normals, axis), 0.0)
            else:
                away = points_m - light.position_m.astype(np.float32)
                distance = np.maximum(np.linalg.norm(away, axis=1), np.float32(1e-3))
                away /= distance[:, None]
                level = np.maximum(-np.einsum("ij,ij->i", normals, away), 0.0) / distance**2
                level *= np.clip(1.0 - (distance / np.float32(light.range_m)) ** 4, 0.0, 1.0)
                if light.kind is LightKind.SPOT:
                    inner, outer = light.cone_cosines
                    inside = np.einsum("ij,j->i", away, axis) - np.float32(outer)
                    level *= np.clip(inside / np.float32(max(inner - outer, 1e-3)), 0.0, 1.0) ** 2
            total += level[:, None] * color
        return total


class _TextureTable:
    """Linear RGBA texels of all textures in one array, so that one lookup serves every hit."""

    def __init__(self, materials: tuple[Material, ...]):
        white = Texture(np.full((1, 1, 4), 255, dtype=np.uint8))
        firsts: dict[int, int] = {}
        texels, rows, first = [], [], 0
        for material in (*materials, Material()):
            texture = white if material.texture is None else material.texture
            height, width = texture.pixels.shape[:2]
            if id(texture) not in firsts:
                firsts[id(texture)] = first
                texels.append(_linear(texture.pixels))
                first += height * width
            clamped = [wrap is Wrap.CLAMP_TO_EDGE for wrap in (texture.wrap_u, texture.wrap_v)]
            rows.append((firsts[id(texture)], width, height, *clamped))
        self._texels = np.concatenate(texels)
        self._rows = np.array(rows, dtype=np.int32)

    def lookup(self, textures: NDArray[np.int_], coordinates: Floats) -> Floats:
        """Bilinearly interpolated colors (n, 4) at coordinates (n, 2) of textures (n,)."""
        first, width, height, clamp_u, clamp_v = self._rows[textures].T
        columns = _linear_weights(coordinates[:, 0], width, clamp_u)
        rows = _linear_weights(coordinates[:, 1], height, clamp_v)
        total = np.zeros((len(textures), 4), dtype=np.float32)
        for row, row_share in rows:
            start = first + row * width
            for column, column_share in columns:
                total += (row_share * column_share)[:, None] * self._texels[start + column]
        return total


def _linear(pixels: NDArray[np.uint8]) -> Floats:
    levels = linear_from_srgb(np.arange(256) / 255.0).astype(np.float32)
    linear = np.empty((*pixels.shape[:2], 4), dtype=np.float32)
    linear[..., :3] = levels[pixels[..., :3]]
    linear[..., 3] = pixels[..., 3] / np.float32(255.0)
    return linear.reshape(-1, 4)


def _linear_weights(
    coordinate: Floats, count: NDArray[np.int32], clamped: NDArray[np.int32]
) -> list[tuple[NDArray[np.int32], Floats]]:
    """Two neighboring texels (n,) along one axis, and their interpolation weights."""
    texel_position = coordinate * count - np.float32(0.5)
    low = np.floor(texel_position)
    share = (texel_position - low).astype(np.float32)
    low = low.astype(np.int32)
    texels = []
    for texel, weight in ((low, 1.0 - share), (low + 1, share)):
        inside = np.where(clamped > 0, np.clip(texel, 0, count - 1), texel % count)
        texels.append((inside, weight.astype(np.float32)))
    return texels
