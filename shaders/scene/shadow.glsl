// float directional_visibility(int i, vec3 position, vec3 normal): share of a light that reaches a
// surface at a position in metres from the effective viewpoint; 1 without SHADOWS.
// float punctual_visibility(int i, vec3 away, vec3 normal): likewise, `away` in metres from the light.
// normal: unit, of the surface's side that is seen.
// DIRECTIONAL_CASTERS, PUNCTUAL_CASTERS: bits of the lights that cast shadows; CUBE_CASTERS: of those
// punctual ones whose maps are the faces of a cube. SHADOW_CASCADES: maps of each directional light.
// The layouts are those in omnisim/gpu/shadows/shadow_plan.py.
// Source of the normal offset: Holbert, "Saying Goodbye to Shadow Acne", GDC 2011.

#ifdef SHADOWS

struct DirectionalMaps {
    vec4 rows[3];  // x, y and forward of the light; scale and shift of depth in the first two
    vec4 cascades[2 * SHADOW_CASCADES];  // middle, inverse of half the width, metres in a texel; region
};
struct PunctualMaps {
    vec4 rows[3];  // x, y and forward of the first map
    vec4 region;   // of the first map
    vec4 scales;   // inverse of the tangent of half the field of view; tangents in a texel
};
layout(std140, binding = 1) uniform ShadowMaps {
#if DIRECTIONAL_LIGHTS > 0
    DirectionalMaps u_directional_maps[DIRECTIONAL_LIGHTS];
#endif
#if PUNCTUAL_LIGHTS > 0
    PunctualMaps u_punctual_maps[PUNCTUAL_LIGHTS];
#endif
};
uniform sampler2DShadow u_shadow_maps;

// Distance in front of a surface at which it is looked up, in texels: more than its depth differs by
// within the filter, a texel to each side. The normal is along the axes of the map.
float offset_texels(vec3 normal) {
    return 0.2 + abs(normal.x) + abs(normal.y);
}

float visibility_at(vec2 local, vec4 region, float depth) {
    return textureLod(u_shadow_maps, vec3(region.xy + local * region.zw, depth), 0.0);
}

#if DIRECTIONAL_LIGHTS > 0
float directional_visibility(int i, vec3 position, vec3 normal) {
    if ((DIRECTIONAL_CASTERS >> i & 1u) == 0u) return 1.0;
    mat3 axes = transpose(mat3(u_directional_maps[i].rows[0].xyz,
                               u_directional_maps[i].rows[1].xyz,
                               u_directional_maps[i].rows[2].xyz));
    vec3 at = axes * (position + SHADOW_VIEWPOINT);
    vec4 cascade = u_directional_maps[i].cascades[2 * SHADOW_CASCADES - 2];
    vec4 region = u_directional_maps[i].cascades[2 * SHADOW_CASCADES - 1];
    for (int finer = SHADOW_CASCADES - 2; finer >= 0; --finer) {
        vec4 other = u_directional_maps[i].cascades[2 * finer];
        vec2 local = abs(at.xy - other.xy) * other.z;
        bool holds = max(local.x, local.y) < 0.98;
        cascade = holds ? other : cascade;
        region = holds ? u_directional_maps[i].cascades[2 * finer + 1] : region;
    }
    vec3 toward = axes * normal;
    at += toward * (cascade.w * offset_texels(toward));
    vec2 local = (at.xy - cascade.xy) * cascade.z;
    float depth = u_directional_maps[i].rows[0].w - at.z * u_directional_maps[i].rows[1].w;
    vec2 inside = abs(local);
    float visibility = visibility_at(clamp(local, -0.999, 0.999), region, depth);
    return max(inside.x, inside.y) < 0.999 ? visibility : 1.0;
}
#endif

#if PUNCTUAL_LIGHTS > 0
float punctual_visibility(int i, vec3 away, vec3 normal) {
    if ((PUNCTUAL_CASTERS >> i & 1u) == 0u) return 1.0;
    vec4 region = u_punctual_maps[i].region, scales = u_punctual_maps[i].scales;
    mat3 axes = transpose(mat3(u_punctual_maps[i].rows[0].xyz, u_punctual_maps[i].rows[1].xyz,
                               u_punctual_maps[i].rows[2].xyz));
    bool is_cube = (CUBE_CASTERS >> i & 1u) != 0u;  // known when compiled, as the light is
    vec3 at = is_cube ? away : axes * away, toward = is_cube ? normal : axes * normal;
    vec3 size = abs(at);
    bool is_z = !is_cube || size.z >= max(size.x, size.y), is_x = size.x >= size.y;
    // x, y and forward of the face, see lamp_views.py
    at = is_z ? at : is_x ? at.yzx : at.zxy;
    toward = is_z ? toward : is_x ? toward.yzx : toward.zxy;
    vec2 tile = vec2(is_z ? 0.0 : is_x ? 1.0 : 2.0, at.z > 0.0 || !is_cube ? 0.0 : 1.0);
    at += toward * (scales.y * abs(at.z) * offset_texels(toward));
    float depth = max(is_cube ? abs(at.z) : at.z, 1e-6);
    // beyond a spot's map is no light
    vec2 local = clamp(at.xy / depth * scales.x, -0.999, 0.999);
    region.xy += 2.0 * tile * region.zw;
    return visibility_at(local, region, LAMP_NEAR_M / depth);
}
#endif

#else

float directional_visibility(int i, vec3 position, vec3 normal) {
    return 1.0;
}

float punctual_visibility(int i, vec3 away, vec3 normal) {
    return 1.0;
}

#endif
