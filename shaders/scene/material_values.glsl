// Material values of a fragment: factors from a table times maps.
// SurfaceValues surface_values(vec2 uv): values at texture coordinates as in scene/surface.frag.
// vec4 material_texel(int index): texel of the material's record.
// vec3 map_coordinates(int map, vec2 uv): texture coordinates and layer of a map.
// The table has MATERIAL_TEXELS texels per material, see
// omnisim/rendering/opengl/world/scene_textures.py.
// METALLIC_ROUGHNESS_MAP, OCCLUSION_MAP, EMISSIVE_MAP: the material has such a map.
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

const int MATERIAL_TEXELS = 20, MATERIALS_IN_ROW = 256;
const int FIRST_MAP = 5;  // two texels per map

struct SurfaceValues {
    float metallic;
    float roughness;
    float occlusion;
    vec3 emissive;
};

vec4 material_texel(int index) {
    int column = RECORD % MATERIALS_IN_ROW;
    ivec2 at = ivec2(MATERIAL_TEXELS * column + index, RECORD / MATERIALS_IN_ROW);
    return texelFetch(u_materials, at, 0);
}

vec3 map_coordinates(int map, vec2 uv) {
    vec4 across = material_texel(FIRST_MAP + 2 * map);
    vec4 down = material_texel(FIRST_MAP + 1 + 2 * map);
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

SurfaceValues surface_values(vec2 uv) {
    vec4 shape = material_texel(1);
    SurfaceValues values = SurfaceValues(shape.x, shape.y, 1.0, material_texel(2).rgb);
#ifdef METALLIC_ROUGHNESS_MAP
    vec2 mapped = texture(u_metallic_roughness_map, map_coordinates(0, uv)).gb;
    values.roughness *= mapped.x;
    values.metallic *= mapped.y;
#endif
#ifdef OCCLUSION_MAP
    values.occlusion += shape.w * (texture(u_occlusion_map, map_coordinates(2, uv)).r - 1.0);
#endif
#ifdef EMISSIVE_MAP
    values.emissive *= texture(u_emissive_map, map_coordinates(3, uv)).rgb;
#endif
    values.metallic = clamp(values.metallic, 0.0, 1.0);
    return values;
}
