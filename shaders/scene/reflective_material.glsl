// Reflectance of a fragment's material: factors from a table times maps.
// Reflectance reflectance_of(vec3 base_color, vec2 uv): reflectance, given the base color.
// vec3 shading_normal(vec3 normal, vec3 position, vec2 uv, float side): unit normal of the surface
//     after normal mapping.
// vec3 coat_shading_normal(…), with the same arguments: that of the clear coat.
// NORMAL_MAP, SPECULAR_MAP, CLEARCOAT_MAP, CLEARCOAT_NORMAL_MAP: the material has such a map.
// Includes scene/material_values.glsl.
// Source: glTF 2.0, section 3.9; KHR_materials_specular, KHR_materials_clearcoat.

#include "scene/material_values.glsl"

#if defined(NORMAL_MAP) || defined(CLEARCOAT_NORMAL_MAP)
vec3 mapped_normal(
    sampler2DArray map, vec3 place, float scale, vec3 normal, vec3 position, float side) {
    vec3 right = dFdx(position), down = dFdy(position);
    vec2 right_uv = dFdx(place.xy), down_uv = dFdy(place.xy);
    float area = right_uv.x * down_uv.y - down_uv.x * right_uv.y;
    vec3 along_u = (right * down_uv.y - down * right_uv.y) * sign(area);
    vec3 along_v = (down * right_uv.x - right * down_uv.x) * sign(area);
    along_u -= normal * dot(normal, along_u);
    vec3 bump = 2.0 * texture(map, place).rgb - 1.0;  // needs derivatives: before any return
    if (dot(along_u, along_u) == 0.0) return normal;
    vec3 tangent = normalize(along_u);
    vec3 bitangent = cross(normal, tangent);
    bitangent *= dot(bitangent, along_v) > 0.0 ? -1.0 : 1.0;  // v points down in textures
    bump.xy *= side * scale;
    return normalize(bump.x * tangent + bump.y * bitangent + bump.z * normal);
}
#endif
#ifdef NORMAL_MAP
uniform sampler2DArray u_normal_map;
#endif
#ifdef CLEARCOAT_NORMAL_MAP
uniform sampler2DArray u_clearcoat_normal_map;
#endif
#ifdef SPECULAR_MAP
uniform sampler2DArray u_specular_map;
#endif
#ifdef CLEARCOAT_MAP
uniform sampler2DArray u_clearcoat_map;
#endif

vec3 shading_normal(vec3 normal, vec3 position, vec2 uv, float side) {
#ifdef NORMAL_MAP
    normal = mapped_normal(
        u_normal_map, map_coordinates(1, uv), material_texel(1).z, normal, position, side);
#endif
    return normal;
}

vec3 coat_shading_normal(vec3 normal, vec3 position, vec2 uv, float side) {
#ifdef CLEARCOAT_NORMAL_MAP
    normal = mapped_normal(
        u_clearcoat_normal_map, map_coordinates(6, uv), material_texel(3).z, normal, position,
        side);
#endif
    return normal;
}

Reflectance reflectance_of(vec3 base_color, vec2 uv) {
    vec4 f0 = material_texel(0), coat = material_texel(3);
#ifdef SPECULAR_MAP
    vec4 gloss = texture(u_specular_map, map_coordinates(4, uv));
    f0.w *= gloss.a;
    f0.rgb = f0.w * min(material_texel(4).rgb * gloss.rgb, vec3(1.0));
#endif
#ifdef CLEARCOAT_MAP
    coat.xy *= texture(u_clearcoat_map, map_coordinates(5, uv)).rg;
#endif
    SurfaceValues values = surface_values(uv);
    float metallic = values.metallic;
    return Reflectance(
        base_color * (1.0 - metallic), f0.rgb, mix(f0.rgb, base_color, metallic),
        f0.w, mix(f0.w, 1.0, metallic), clamp(values.roughness, MIN_ROUGHNESS, 1.0),
        coat.x, clamp(coat.y, MIN_ROUGHNESS, 1.0), values.occlusion, values.emissive);
}
