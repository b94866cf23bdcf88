"""Smooth surfaces whose reflections of the scene the back end of cubes leaves out."""

from __future__ import annotations

from omnisim.core.short_repr import counted
from omnisim.scene import Scene
from omnisim.scene.model import Material
from omnisim.scene.surface_reflectance import MAX_TRACED_ROUGHNESS


def reflection_note(scene: Scene) -> str | None:
    """Note on materials that reflect the scene by rays only; None: no such material."""
    if scene.lighting.is_matte:
        return None
    used = {scene.meshes[one.mesh].material for one in scene.instances}
    count = sum(reflects_scene(scene.materials[number]) for number in used)
    if not count:
        return None
    return (
        f"reflections show the sky and lamps, not the scene ({counted(count, 'material')}): "
        "--backend rays shows it"
    )


def reflects_scene(material: Material) -> bool:
    """True for a material that reflects the scene by rays: smooth metal, gloss or clear coat."""
    if material.is_matte:
        return False
    roughness = material.roughness
    if material.metallic_roughness_map is not None:
        roughness *= float(material.metallic_roughness_map.pixels[..., 1].min()) / 255.0
    is_glossy = bool(material.metallic or material.specular)
    is_coated = bool(material.clearcoat) and material.clearcoat_roughness <= MAX_TRACED_ROUGHNESS
    return is_coated or (is_glossy and roughness <= MAX_TRACED_ROUGHNESS)
