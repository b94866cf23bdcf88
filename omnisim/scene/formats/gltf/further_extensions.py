"""Registered extensions that omnisim can ignore or does not support.

Source: https://github.com/KhronosGroup/glTF, extensions/2.0, July 2026.
"""

from __future__ import annotations

# Extensions without effect on an image.
IGNORED = {
    "KHR_xmp_json_ld, KHR_xmp": "metadata",
    "KHR_interactivity, KHR_node_hoverability, KHR_node_selectability": "behavior",
    "KHR_implicit_shapes, KHR_physics_rigid_bodies": "collisions",
    "KHR_audio_emitter": "sound",
    "EXT_mesh_manifold": "the same triangles, in another order",
    "EXT_mesh_features, EXT_instance_features, EXT_structural_metadata": "metadata",
    "FB_geometry_metadata, GRIFFEL_bim_data, AGI_stk_metadata, GODOT_single_root": "metadata",
    "AGI_articulations": "behavior",
    "MSFT_lod": "the finest level is drawn",
    "MSFT_packing_normalRoughnessMetallic, MSFT_packing_occlusionRoughnessMetallic": (
        "the maps of the plain material are drawn"
    ),
}
# Other image formats; files also contain plain images, unless they require these.
OTHER_IMAGES = ("EXT_texture_astc", "EXT_texture_avif", "MSFT_texture_dds")
# Extensions with a visible effect, which are not supported.
LEFT_OUT = {
    "KHR_gaussian_splatting": "splats are points, which are not drawn",
    "KHR_materials_volume_scatter": "light in volumes is not drawn",
    "KHR_techniques_webgl": "shaders of files are not run",
    "EXT_lights_ies": "lamps emit equally in all directions, or by their cone",
    "EXT_lights_image_based": "`[sky]` of a scene's TOML is an environment map",
    "EXT_mesh_primitive_edge_visibility, CESIUM_primitive_outline": "edges are not drawn",
    "EXT_mesh_primitive_restart": "strips and fans are one each",
    "ADOBE_materials_clearcoat_specular, ADOBE_materials_clearcoat_tint": (
        "clear coats are colorless, of index 1.5"
    ),
    "ADOBE_materials_thin_transparency": "transmission is not drawn",
    "NV_materials_mdl": "the plain material is drawn",
    "MPEG_media, MPEG_texture_video": "films as textures are not played",
    "MPEG_accessor_timed, MPEG_animation_timing, MPEG_buffer_circular, MPEG_scene_dynamic": (
        "streams are not read"
    ),
    "MPEG_audio_spatial, MPEG_mesh_linking, MPEG_viewport_recommended": "not read",
}
