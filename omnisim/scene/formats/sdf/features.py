"""Features of SDFormat, versions 1.4 to 1.12."""

from __future__ import annotations

from xml.etree.ElementTree import Element

from omnisim.scene.formats.features import Feature, Support

_APPLIED, _LEFT_OUT, _IGNORED = Support.APPLIED, Support.LEFT_OUT, Support.IGNORED
_OFF = ("0", "false", "none", "")


def is_on(element: Element) -> bool:
    """True for an element whose text is neither empty, false, 0 nor none."""
    return (element.text or "").strip().lower() not in _OFF


def _is_zero(element: Element) -> bool:
    return not is_on(element)


def _has_fog(element: Element) -> bool:
    return element.findtext("type", "none").strip() != "none"


SDF_FEATURES = (
    Feature("world, model, link, visual, geometry, name, @name, @version", _APPLIED, "one instance a visual"),
    Feature(
        "box, sphere, ellipsoid, cylinder, cone, capsule, size, radius, radii, length", _APPLIED,
        "round ones to 0.02 % of their radius, coarser where there are more than 20",
    ),
    Feature("plane, normal", _APPLIED, "seen from both sides"),
    Feature("polyline, point, height", _APPLIED, "several of a geometry are outlines and holes"),
    Feature(
        "mesh, uri, scale, submesh, submesh/name, center", _APPLIED,
        "every format of scenes, turned by none of them, as in Gazebo; COLLADA's unit counts; a "
        "submesh of COLLADA is a node, as in Gazebo",
    ),
    Feature("mesh@optimization, convex_decomposition", _IGNORED, "of collisions"),
    Feature(
        "heightmap, texture, blend, min_height, fade_dist, pos", _APPLIED,
        "of gray images, up to 513 points a side; several textures are blended into one",
    ),
    Feature("sampling, use_terrain_paging", _IGNORED, "density of the terrain"),
    Feature("texture/normal", _LEFT_OUT, "normal maps of terrains are not drawn", "heightmap"),
    Feature("image", _LEFT_OUT, "<image> is not drawn", "visual"),
    Feature(
        "include, merge, placement_frame, @merge, @placement_frame", _APPLIED,
        "of `model://`, `file://` and Gazebo Fuel's addresses, by `model.config`",
    ),
    Feature("experimental:params", _LEFT_OUT, "parameters of includes are not applied", "include"),
    Feature(
        "pose, frame, @relative_to, @degrees, @rotation_format, @frame, @attached_to", _APPLIED,
        "nested models, `model::frame`; `frame` of older versions",
    ),
    Feature("joint/*", _APPLIED, "as a frame: joints are at rest"),
    Feature("state/*", _APPLIED, "poses of models, links and lights that Gazebo Classic has saved"),
    Feature(
        "material, diffuse, ambient, transparency, double_sided", _APPLIED,
        "colors are linear, as in today's Gazebo; `ambient` without `diffuse`; a material replaces "
        "those of its mesh",
    ),
    Feature("emissive, lighting", _APPLIED, "an emissive map without a color is white"),
    Feature(
        "pbr, metal, pbr/specular, albedo_map, roughness, metalness, roughness_map, "
        "metalness_map, normal_map, ambient_occlusion_map, emissive_map, normal_map@type",
        _APPLIED, "metal and roughness are 0.5 where they are not stated",
    ),
    Feature(
        "specular_map, glossiness_map, glossiness", _LEFT_OUT,
        "specular color and glossiness are not drawn", "material", is_on,
    ),
    Feature(
        "environment_map", _LEFT_OUT, "environment maps of materials are not drawn", "material", is_on
    ),
    Feature("light_map", _LEFT_OUT, "light maps are not drawn", "material", is_on),
    Feature(
        "specular, shininess, shader, render_order", _IGNORED,
        "what has no `pbr` is matte, as in today's Gazebo",
    ),
    Feature(
        "script, script/name", _APPLIED,
        "color and texture of OGRE's scripts; Gazebo's own colors, its textures as one color",
    ),
    Feature("cast_shadows", _APPLIED, "of visuals and lights"),
    Feature(
        "light, @type, light_on, intensity, direction, spot, inner_angle, outer_angle", _APPLIED,
        "directional, point, spot; with shadows where `cast_shadows` is true, but for point "
        "lights, as in Gazebo; intensities are relative",
    ),
    Feature(
        "attenuation, range, constant, linear, quadratic", _APPLIED,
        "becomes that of 1/distance², equal at a quarter of its range or 5 m, with a note",
    ),
    Feature("falloff", _LEFT_OUT, "the falloff of spots is that of glTF", "light", is_on),
    Feature("scene, background", _APPLIED, "rays without a hit"),
    Feature("sky", _LEFT_OUT, "the sky is drawn in one color"),
    Feature("fog", _LEFT_OUT, "fog is not drawn", "", _has_fog),
    Feature("scene/ambient", _LEFT_OUT, "ambient light is omnisim's, not that of the scene", "scene"),
    Feature("shadows", _LEFT_OUT, "shadows are drawn, as lights state them", "scene", _is_zero),
    Feature("sensor", _APPLIED, "cameras are viewpoints, with their lenses: `--at-camera`"),
    Feature("actor", _LEFT_OUT, "actors are not drawn"),
    Feature("road", _LEFT_OUT, "roads are not drawn"),
    Feature("population", _LEFT_OUT, "populations of models are not made"),
    Feature("projector", _LEFT_OUT, "projectors are not drawn", "element"),
    Feature("particle_emitter", _LEFT_OUT, "particle_emitters are not drawn", "element"),
    Feature(
        "collision, plugin, physics, gui, inertial, static, self_collide, allow_auto_disable, "
        "kinematic, gravity, magnetic_field, atmosphere, wind, enable_wind, must_be_base_link, "
        "velocity_decay, gripper, battery, audio, audio_source, audio_sink, spherical_coordinates, "
        "laser_retro, visibility_flags, meta, grid, origin_visual, visualize, origin, @xmlns, "
        "@canonical_link",
        _IGNORED, "they show nothing",
    ),
)  # fmt: skip
