// Reflectance of a fragment's material: numbers of a table, times its maps.
// Reflectance reflectance_of(vec3 base_color, vec2 uv): base colour as in scene/surface.frag.
// vec3 mapped_normal(vec3 normal, vec3 position, vec2 uv, float side): unit normal by the normal map.
// NORMAL_MAP: the material has one. Includes scene/material_values.glsl.
// Source: glTF 2.0, section 3.9.

#include "scene/material_values.glsl"

#ifdef NORMAL_MAP
uniform sampler2DArray u_normal_map;

vec3 mapped_normal(vec3 normal, vec3 position, vec2 uv, float side) {
    vec3 place = map_coordinates(1, uv);
    vec3 right = dFdx(position), down = dFdy(position);
    vec2 right_uv = dFdx(place.xy), down_uv = dFdy(place.xy);
    float area = right_uv.x * down_uv.y - down_uv.x * right_uv.y;
    vec3 along_u = (right * down_uv.y - down * right_uv.y) * sign(area);
    vec3 along_v = (down * right_uv.x - right * down_uv.x) * sign(area);
    along_u -= normal * dot(normal, along_u);
    if (dot(along_u, along_u) == 0.0) return normal;
    vec3 tangent = normalize(along_u);
    vec3 bitangent = cross(normal, tangent);
    bitangent *= dot(bitangent, along_v) > 0.0 ? -1.0 : 1.0;  // v runs down a texture
    vec3 bump = 2.0 * texture(u_normal_map, place).rgb - 1.0;
    bump.xy *= side * material_texel(1).z;
    return normalize(bump.x * tangent + bump.y * bitangent + bump.z * normal);
}
#endif

Reflectance reflectance_of(vec3 base_color, vec2 uv) {
    vec4 f0 = material_texel(0), coat = material_texel(3);
    SurfaceValues values = surface_values(uv);
    float metallic = values.metallic;
    return Reflectance(
        base_color * (1.0 - metallic), f0.rgb, mix(f0.rgb, base_color, metallic),
        f0.w, mix(f0.w, 1.0, metallic), clamp(values.roughness, MIN_ROUGHNESS, 1.0),
        coat.x, clamp(coat.y, MIN_ROUGHNESS, 1.0), values.occlusion, values.emissive);
}
