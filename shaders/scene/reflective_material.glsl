// Reflectance of a fragment's material: numbers of a table, times its maps.
// Reflectance reflectance_of(vec3 base_color, vec2 uv): base colour as in scene/surface.frag.
// vec3 mapped_normal(vec3 normal, vec3 position, vec2 uv, float side): unit normal by the normal map.
// The table has MATERIAL_TEXELS texels a material, see omnisim/gpu/scene/material_table.py.
// METALLIC_ROUGHNESS_MAP, NORMAL_MAP, OCCLUSION_MAP, EMISSIVE_MAP: the material has such a map.
// Source: glTF 2.0, section 3.9.

uniform sampler2D u_materials;
#ifdef CLUSTERED
flat in int v_record;
#define RECORD v_record
#else
uniform int u_record;
#define RECORD u_record
#endif
#ifdef SECOND_COORDINATES
in vec2 v_second_coordinate;
#endif

const int MATERIAL_TEXELS = 12, MATERIALS_IN_ROW = 256;
const int FIRST_MAP = 4;  // two texels for each

vec4 material_texel(int index) {
    int column = RECORD % MATERIALS_IN_ROW;
    ivec2 at = ivec2(MATERIAL_TEXELS * column + index, RECORD / MATERIALS_IN_ROW);
    return texelFetch(u_materials, at, 0);
}

// Texture coordinates and layer of a map.
vec3 map_coordinates(int map, vec2 uv) {
    vec4 across = material_texel(FIRST_MAP + 2 * map), down = material_texel(FIRST_MAP + 1 + 2 * map);
#ifdef SECOND_COORDINATES
    if (down.w > 0.5) uv = v_second_coordinate;
#endif
    vec3 place = vec3(uv, 1.0);
    return vec3(dot(across.xyz, place), dot(down.xyz, place), across.w);
}

#ifdef METALLIC_ROUGHNESS_MAP
uniform sampler2DArray u_metallic_roughness_map;
#endif
#ifdef OCCLUSION_MAP
uniform sampler2DArray u_occlusion_map;
#endif
#ifdef EMISSIVE_MAP
uniform sampler2DArray u_emissive_map;
#endif
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
    vec4 f0 = material_texel(0), shape = material_texel(1), coat = material_texel(3);
    float metallic = shape.x, roughness = shape.y;
#ifdef METALLIC_ROUGHNESS_MAP
    vec2 mapped = texture(u_metallic_roughness_map, map_coordinates(0, uv)).gb;
    roughness *= mapped.x;
    metallic *= mapped.y;
#endif
    float occlusion = 1.0;
#ifdef OCCLUSION_MAP
    occlusion += material_texel(1).w * (texture(u_occlusion_map, map_coordinates(2, uv)).r - 1.0);
#endif
    vec3 emissive = material_texel(2).rgb;
#ifdef EMISSIVE_MAP
    emissive *= texture(u_emissive_map, map_coordinates(3, uv)).rgb;
#endif
    metallic = clamp(metallic, 0.0, 1.0);
    return Reflectance(
        base_color * (1.0 - metallic), f0.rgb, mix(f0.rgb, base_color, metallic),
        f0.w, mix(f0.w, 1.0, metallic), clamp(roughness, MIN_ROUGHNESS, 1.0),
        coat.x, clamp(coat.y, MIN_ROUGHNESS, 1.0), occlusion, emissive);
}
