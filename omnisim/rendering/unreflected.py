"""Notices on reflective and transmissive materials, for back ends without reflections."""

from __future__ import annotations

from omnisim.core.short_repr import counted
from omnisim.scene import Scene
from omnisim.scene.model import Material
from omnisim.scene.surface_reflectance import MAX_TRACED_ROUGHNESS


def reflection_notes(scene: Scene) -> list[str]:
    """Notices on materials that reflect or transmit the scene with `--backend rays` only."""
    if scene.lighting.is_matte:
        return []
    used = {scene.meshes[one.mesh].material for one in scene.instances}
    materials = [scene.materials[number] for number in used]
    mirrors = sum(reflects_scene(one) for one in materials)
    panes = sum(one.transmission > 0.0 and not one.unlit for one in materials)
    notes = {
        f"reflections show the sky and lamps, not the scene ({counted(mirrors, 'material')}): "
        "--backend rays shows it": mirrors,
        f"panes are opaque ({counted(panes, 'material')}): "
        "--backend rays shows what is behind them": panes,
    }
    return [note for note, count in notes.items() if count]


def reflects_scene(material: Material) -> bool:
    """True if the ray back end traces reflections: smooth metal, gloss or clear coat."""
    if material.is_matte:
        return False
    roughness = material.roughness
    if material.metallic_roughness_map is not None:
        roughness *= float(material.metallic_roughness_map.pixels[..., 1].min()) / 255.0
    is_glossy = bool(material.metallic or material.specular)
    is_coated = bool(material.clearcoat) and material.clearcoat_roughness <= MAX_TRACED_ROUGHNESS
    return is_coated or (is_glossy and roughness <= MAX_TRACED_ROUGHNESS)
