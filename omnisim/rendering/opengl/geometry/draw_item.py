"""Draw items: instances of meshes, ready to draw, and their transforms in one frame."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import NamedTuple

import moderngl
import numpy as np
from numpy.typing import NDArray

from omnisim.rendering.opengl.materials.scene_textures import MaterialTexture
from omnisim.scene.model import Material, Mesh
from omnisim.scene.motion.deformation import Sphere
from omnisim.scene.parts import LightRectangle

MAX_DISTANCE_M = 1500.0


class LightSource(Enum):
    """Source of the light on a lit surface, with the defines of its programs.

    They are words: an empty tuple is no value of an `Enum` in Python 3.11.2.
    """

    COMPUTED = ""
    LIGHTMAP = "LIGHTMAP"
    PROBES = "PROBES"
    LIGHTMAP_OR_PROBES = "LIGHTMAP PROBES"  # of vertices with and without light coordinates

    @property
    def defines(self) -> list[str]:
        """Defines of the programs."""
        return self.value.split()

    @property
    def is_baked(self) -> bool:
        """It is the scene's baked light."""
        return self is not LightSource.COMPUTED

    @property
    def is_mapped(self) -> bool:
        """It is the lightmap's, at least of some vertices."""
        return "LIGHTMAP" in self.defines


@dataclass(frozen=True, eq=False)
class DrawItem:
    """One instance of one mesh, ready to draw.

    Attributes:
        name: of the instance.
        object_index: of the dynamic object that it belongs to; None: it is static.
        mesh: its mesh.
        first, count: its indices in the index buffer.
        base: first vertex of its mesh in the vertex buffer.
        material: of the mesh.
        texture_layer: of the material on the mesh.
        object_from_mesh: (4, 4) float64, into the world or the dynamic object's frame.
        normal_from_mesh: (3, 3) cofactors of its linear part, signed so that normals stay outside.
        flips_winding: its triangles are wound the other way round in the world.
        center_m, radius_m: its bounding sphere in the world or the dynamic object's frame.
        light: on it.
        light_rectangles: of its front and back in the lightmap, if it has any.
    """

    name: str
    object_index: int | None
    mesh: Mesh
    first: int
    count: int
    base: int
    material: Material
    texture_layer: MaterialTexture
    object_from_mesh: NDArray[np.float64]
    normal_from_mesh: NDArray[np.float64]
    flips_winding: bool
    center_m: NDArray[np.float64]
    radius_m: float
    light: LightSource = LightSource.COMPUTED
    light_rectangles: tuple[LightRectangle, ...] = ()

    @property
    def triangles(self) -> int:
        """Number of triangles."""
        return self.count // 3

    def is_near(self, anchor_m: NDArray[np.float64]) -> bool:
        """Tell whether floats resolve a tenth of a millimeter of it.

        They count from the origin of its object, the anchor (3,) where it is static.
        """
        origin_m = anchor_m if self.object_index is None else np.zeros(3)
        return bool(np.linalg.norm(self.center_m - origin_m) + self.radius_m <= MAX_DISTANCE_M)

    def sphere_at(self, time_s: float) -> Sphere:
        """Bounding sphere at a time, in the world or the dynamic object's frame."""
        if self.mesh.deformation is None:
            return Sphere(self.center_m, self.radius_m)
        center, radius = self.mesh.deformation.sphere_at(time_s)
        linear = self.object_from_mesh[:3, :3]
        scale = float(np.linalg.norm(linear, 2))
        return Sphere(linear @ center + self.object_from_mesh[:3, 3], scale * radius)

    @property
    def moves(self) -> bool:
        """True where it is part of a dynamic object, or its mesh deforms."""
        return self.object_index is not None or self.mesh.deformation is not None

    @property
    def texture(self) -> moderngl.Texture:
        """Texture alone; white where the material has none."""
        return self.texture_layer.texture

    @property
    def is_blended(self) -> bool:
        """Transparency: surfaces behind it shine through."""
        return self.material.is_blended


class InstanceTransforms(NamedTuple):
    """Transforms of all draw items in one frame, into the viewpoint frame.

    Attributes:
        viewpoint_from_mesh: (n, 4, 4).
        normal_from_mesh: (n, 3, 3), see `DrawItem`.
        centers_m, radii_m: (n, 3) and (n,) of the bounding spheres.
    """

    viewpoint_from_mesh: NDArray[np.float64]
    normal_from_mesh: NDArray[np.float64]
    centers_m: NDArray[np.float64]
    radii_m: NDArray[np.float64]
