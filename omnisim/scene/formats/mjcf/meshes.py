"""Meshes of a MuJoCo model's geoms, each created once per shape and appearance."""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

from omnisim.scene.files.imported_scene import make_mesh
from omnisim.scene.formats.mjcf.geometry import Geom, Shape, geom_shape
from omnisim.scene.formats.mjcf.materials import Materials, Rgba, own_or_material_rgba
from omnisim.scene.formats.mjcf.texture_mapping import MappedSurface, map_cube, map_plane
from omnisim.scene.parts import Mesh

# Geoms with an inside; for meshes and height fields this is unknown.
_SOLIDS = (
    Geom.mjGEOM_PLANE, Geom.mjGEOM_SPHERE, Geom.mjGEOM_CAPSULE, Geom.mjGEOM_ELLIPSOID,
    Geom.mjGEOM_CYLINDER, Geom.mjGEOM_BOX,
)  # fmt: skip
# Mesh indices of a geom, with the mesh centers in the geom's frame.
Parts = tuple[tuple[int, NDArray[np.float64]], ...]


class Meshes:
    """Meshes of a model.

    Attributes:
        entries: meshes created so far.
        materials: materials of the meshes.
    """

    def __init__(self, model: mujoco.MjModel):
        self.entries: list[Mesh] = []
        self.materials = Materials(model)
        self._model = model
        self._shapes: dict[tuple[object, ...], Shape] = {}
        self._parts: dict[tuple[object, ...], Parts] = {}

    def rgba(self, geom: int) -> Rgba:
        """Effective color of a geom, sRGB."""
        model = self._model
        return own_or_material_rgba(model, model.geom_rgba[geom], int(model.geom_matid[geom]))

    def of_geom(self, geom: int, name: str) -> Parts:
        """Meshes of a geom, created under `name` if they are new."""
        model = self._model
        kind, material = int(model.geom_type[geom]), int(model.geom_matid[geom])
        shape_key = (kind, int(model.geom_dataid[geom]), *model.geom_size[geom].tolist())
        key = (*shape_key, material, self.rgba(geom))
        if key not in self._parts:
            if shape_key not in self._shapes:
                self._shapes[shape_key] = geom_shape(model, geom)
            mapped = self._map(self._shapes[shape_key], material, model.geom_size[geom])
            self._parts[key] = tuple(
                self._add(name, part, material, self.rgba(geom), kind) for part in mapped
            )
        return self._parts[key]

    def add(self, name: str, mapped: MappedSurface, material: int, rgba: Rgba) -> Parts:
        """Double-sided meshes of skins and flexible bodies."""
        return (self._add(name, mapped, material, rgba, None),)

    def _map(self, shape: Shape, material: int, sizes: NDArray[np.float64]) -> list[MappedSurface]:
        """Parts of a shape, with texture coordinates if the material has a texture."""
        model = self._model
        texture = self.materials.color_texture(material)
        plain = MappedSurface(None, shape.surface, shape.texture_coordinates)
        if texture is None:
            return [plain]
        is_uniform = bool(model.mat_texuniform[material])
        if not self.materials.textures.is_cube(texture):
            if shape.texture_coordinates is not None:
                return [plain]
            return [map_plane(shape, model.mat_texrepeat[material], sizes, is_uniform)]
        if self.materials.textures.plain_color(texture) is not None:
            return [plain]
        return map_cube(shape, sizes, is_uniform)

    def _add(
        self, name: str, mapped: MappedSurface, material: int, rgba: Rgba, kind: int | None
    ) -> tuple[int, NDArray[np.float64]]:
        surface = mapped.surface
        index = self.materials.index(
            material, rgba, mapped.face, kind in _SOLIDS, kind == Geom.mjGEOM_PLANE
        )
        mesh, center = make_mesh(
            name,
            surface.positions,
            surface.triangles,
            index,
            surface.normals,
            mapped.texture_coordinates,
        )
        self.entries.append(mesh)
        return len(self.entries) - 1, center
