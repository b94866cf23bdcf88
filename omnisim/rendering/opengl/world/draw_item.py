"""Draw items: instances of meshes ready to draw, and their transforms for one image."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from functools import cached_property
from typing import NamedTuple

import moderngl
import numpy as np

from omnisim.core.arrays import Bools, Floats, Indices, bounds_of
from omnisim.rendering.atlas.tile_plan import PosedViews
from omnisim.rendering.opengl.world.scene_textures import MaterialTexture
from omnisim.scene.model import Material, Mesh
from omnisim.scene.motion.deformation import Sphere
from omnisim.scene.parts import BLENDED_CUTOFF, LightRectangle
from omnisim.scene.planar_mirrors import SceneSurface
from omnisim.scene.surface_kind import SurfaceKind, clear_share, kind_of

MAX_DISTANCE_M = 2048.0  # up to which float32 rounds to 0.07 mm, and beyond to 0.13 mm
_MAX_SEARCHED_TRIANGLES = 1024  # 10 µs
_EDGE_ON = 1e-4  # relative to the radius: nearer to its plane, a triangle may turn either side


class LightSource(Enum):
    """Source of the light on a lit surface; the values are the defines of its programs.

    They are strings, because Python 3.11.2 does not take an empty tuple as an `Enum` value.
    """

    COMPUTED = ""
    LIGHTMAP = "LIGHTMAP"
    PROBES = "PROBES"
    LIGHTMAP_OR_PROBES = "LIGHTMAP PROBES"  # mixed vertices, with and without light coordinates

    @property
    def defines(self) -> list[str]:
        """Defines of the programs."""
        return self.value.split()

    @property
    def is_baked(self) -> bool:
        """True for the scene's baked light."""
        return self is not LightSource.COMPUTED

    @property
    def is_mapped(self) -> bool:
        """True if at least some vertices have light from the lightmap."""
        return "LIGHTMAP" in self.defines


@dataclass(frozen=True, eq=False)
class DrawItem:
    """Instance of one mesh, ready to draw."""

    name: str  # name of the instance
    object_index: int | None  # index of its dynamic object; None: static
    mesh: Mesh
    first: int  # range in the index buffer
    count: int
    base: int  # first vertex of its mesh in the vertex buffer
    material: Material
    texture_layer: MaterialTexture  # textures of the material on this mesh
    object_from_mesh: Floats  # (4, 4) float64, to the world or the dynamic object's frame
    normal_from_mesh: Floats  # (3, 3) cofactors of its linear part, signed to keep normals outward
    flips_winding: bool  # True if the transform reverses the winding of triangles
    center_m: Floats  # bounding sphere in the world or the dynamic object's frame
    radius_m: float
    light: LightSource = LightSource.COMPUTED  # source of the light on it
    light_rectangles: tuple[LightRectangle, ...] = ()  # of front and back; empty: no lightmap

    @property
    def triangles(self) -> int:
        """Number of triangles."""
        return self.count // 3

    @cached_property
    def triangle_centers(self) -> Floats:
        """Centers (triangles, 3) of the triangles at rest, in the mesh's frame."""
        return self.mesh.positions[self.mesh.triangles].mean(axis=1, dtype=np.float64)

    def is_near(self, anchor_m: Floats) -> bool:
        """True if float32 coordinates on the item are right to 0.1 mm.

        Positions are relative to its object's origin; for static items, to the anchor (3,).
        """
        origin_m = anchor_m if self.object_index is None else np.zeros(3)
        offsets_m = np.abs(self.center_m - origin_m)
        if offsets_m.max() + self.radius_m <= MAX_DISTANCE_M:
            return True
        if offsets_m.max() > MAX_DISTANCE_M:
            return False
        # the box of wide ground may fit where its sphere does not
        low, high = bounds_of(self.mesh.positions).astype(np.float64)
        halves_m = np.abs(self.object_from_mesh[:3, :3]) @ (0.5 * (high - low))
        return bool((offsets_m + halves_m).max() <= MAX_DISTANCE_M)

    def sphere_at(self, time_s: float) -> Sphere:
        """Bounding sphere at a time, in the world or the dynamic object's frame."""
        if self.mesh.deformation is None:
            return Sphere(self.center_m, self.radius_m)
        center, radius = self.mesh.deformation.sphere_at(time_s)
        linear = self.object_from_mesh[:3, :3]
        scale = float(np.linalg.norm(linear, 2))
        return Sphere(linear @ center + self.object_from_mesh[:3, 3], scale * radius)

    @cached_property
    def _front_planes(self) -> Floats:
        """Planes (n, 4) of the fronts: unit normals and offsets, world or its object's."""
        positions_m = self.mesh.positions @ self.object_from_mesh[:3, :3].T
        positions_m += self.object_from_mesh[:3, 3]
        first_m, second_m, third_m = np.moveaxis(positions_m[self.mesh.triangles], 1, 0)
        normals = np.cross(second_m - first_m, third_m - first_m)
        lengths = np.linalg.norm(normals, axis=1)
        normals[lengths > 0.0] /= lengths[lengths > 0.0, None]
        if self.flips_winding:
            normals = -normals
        offsets_m = -np.einsum("nc,nc->n", normals, first_m)
        return np.column_stack((normals, offsets_m))[lengths > 0.0]

    def shows(self, viewpoint_m: Floats) -> bool:
        """False if nothing of the item is visible: all of its triangles turn away.

        True for large meshes, whatever they show, since the search takes time in each frame.

        Args:
            viewpoint_m: (3,) viewpoint in the world, or in the dynamic object's frame.
        """
        is_plain = not self.material.double_sided and self.mesh.deformation is None
        if not is_plain or self.triangles > _MAX_SEARCHED_TRIANGLES:
            return True
        planes = self._front_planes
        heights_m = planes[:, :3] @ viewpoint_m + planes[:, 3]
        return bool((heights_m > -_EDGE_ON * self.radius_m).any())

    @property
    def moves(self) -> bool:
        """True for parts of dynamic objects and for deforming meshes."""
        return self.object_index is not None or self.mesh.deformation is not None

    @property
    def texture(self) -> moderngl.Texture:
        """Texture of the material alone; white for untextured materials."""
        return self.texture_layer.texture

    @cached_property
    def kind(self) -> SurfaceKind:
        """Kind of the surface, as the scene shows it."""
        return kind_of(self.material, is_matte=self.texture_layer.reflectance is None)

    @property
    def surface(self) -> SceneSurface:
        """Surface for the search of mirrors and probes."""
        return SceneSurface(
            self.mesh, self.material, self.kind, self.object_from_mesh, self.object_index
        )

    @property
    def casts_shadow(self) -> bool:
        """True for surfaces in shadow maps: not glass that passes at least half of the light."""
        is_shiny = self.texture_layer.reflectance is not None
        is_clear = is_shiny and clear_share(self.material) >= BLENDED_CUTOFF
        return self.material.casts_shadow and not is_clear

    @property
    def is_blended(self) -> bool:
        """True for blended materials and panes, through which the background is visible."""
        return bool(self.kind & SurfaceKind.SEE_THROUGH)


class InstanceTransforms(NamedTuple):
    """Transforms of all draw items to the viewpoint frame, for one image."""

    viewpoint_from_mesh: Floats  # (n, 4, 4) matrices
    normal_from_mesh: Floats  # (n, 3, 3), see `DrawItem`
    centers_m: Floats  # (n, 3) of the bounding spheres
    radii_m: Floats  # (n,)

    def seen_in(self, views: PosedViews, items: Indices) -> Bools:
        """Mask (tiles, n) of the items (n,) whose bounding spheres may be in view."""
        return views.cull(self.centers_m[items], self.radii_m[items])
