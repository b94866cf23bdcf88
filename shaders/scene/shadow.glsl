// float directional_visibility(int i, vec3 position): share of a light that reaches a surface at a
//     position in meters from the effective viewpoint; 1 without SHADOWS.
// float punctual_visibility(int i, vec3 away, vec3 area): the same for a punctual light; away:
//     meters from the light.
// vec3 surface_area(vec3 position): area of the surface within an image texel, times its normal.
// DIRECTIONAL_CASTERS, PUNCTUAL_CASTERS: bit masks of the lights that cast shadows. CUBE_CASTERS:
// bit mask of punctual casters with a cube of maps. DIRECTIONAL_SHADOWS, PUNCTUAL_SHADOWS: numbers
// of casters. SHADOW_CASCADES: maps per directional light.
// SHADOW_REGIONS: middle and half size of each caster's first map in the texture. SHADOW_TEXELS:
// texel sizes, on maps from -1 to 1. SHADOW_SCALES: 1 over the tangent of half the field of view;
// for directional lights, depth of half a map's width. These are constants, because a buffer load
// would cost more than the arithmetic.
// Surfaces are offset along their triangles' normals, because vertex normals may differ.
// Source of the normal offset: Holbert, "Saying Goodbye to Shadow Acne", GDC 2011.

#ifdef SHADOWS

uniform sampler2DShadow u_shadow_maps;
const vec4 REGIONS[] = SHADOW_REGIONS;
const float TEXELS[] = SHADOW_TEXELS, SCALES[] = SHADOW_SCALES;

#if PLACES > 0
#include "scene/shadow_places.glsl"
#ifdef VERTEX_PLACES
in vec3 v_places[PLACES];
#define PLACE(place, position) v_places[place]
#else
#define PLACE(place, position) place_on_map(place, position)
#endif
#endif

int bits_below(uint bits, int i) {
    return bitCount(bits & ((1u << i) - 1u));
}

vec3 surface_area(vec3 position) {
    return cross(dFdx(position), dFdy(position));
}

// Mip level of a map.
struct MapLevel {
    float number;
    float texel;  // texel size, on maps from -1 to 1
};

// Level whose texels are at most twice as large as an image texel; area: area of that texel on the
// map.
MapLevel level_for(float area, float finest) {
    float texels = area / (finest * finest);
    return texels < 1.0 ? MapLevel(0.0, finest)
        : texels < 4.0 ? MapLevel(1.0, 2.0 * finest)
        : texels < 16.0 ? MapLevel(2.0, 4.0 * finest) : MapLevel(3.0, 8.0 * finest);
}

// Offset from a surface to its lookup, in texels. It exceeds the surface's variation of depth
// within the filter, which reaches one texel to each side. area: components along the map's axes
// and toward the light.
vec3 offset_texels(vec3 area) {
    vec3 normal = area * inversesqrt(max(dot(area, area), 1e-37));
    return normal * (0.2 + abs(normal.x) + abs(normal.y));
}

// slope: sum of the depth changes along x and y. The offset suits the finest level, because it also
// moves the shadow's edge; coarser levels compare with a nearer depth instead.
float visibility_at(
    vec2 local, float depth, float slope, vec4 region, MapLevel level, float finest) {
    float coarser = level.texel - finest, most = 1.0 - 0.5 * level.texel;
    depth += coarser * slope;
    // a coarse texel has the depth of the first texel that it covers
    local = clamp(local + 0.5 * coarser, -most, most);
    return textureLod(u_shadow_maps, vec3(region.xy + local * region.zw, depth), level.number);
}

#if DIRECTIONAL_SHADOWS > 0
float directional_visibility(int i, vec3 position) {
    if ((DIRECTIONAL_CASTERS >> i & 1u) == 0u) return 1.0;
    int caster = bits_below(DIRECTIONAL_CASTERS, i);
    vec4 region = REGIONS[caster];
    float finest = TEXELS[caster];
    vec3 at = PLACE(caster, position), area = cross(dFdx(at), dFdy(at));
    area *= area.z < 0.0 ? -1.0 : 1.0;
    vec3 cascade = vec3(0.0, 0.0, 1.0);
#if SHADOW_CASCADES > 1
    int first = caster * (SHADOW_CASCADES - 1), number = SHADOW_CASCADES - 1;
    for (int finer = SHADOW_CASCADES - 2; finer >= 0; --finer) {
        vec3 other = u_cascade_from_place[first + finer].xyz;
        vec2 local = abs(at.xy * other.z + other.xy);
        bool holds = max(local.x, local.y) < 0.98;
        cascade = holds ? other : cascade;
        number = holds ? finer : number;
    }
    region.x += 2.0 * float(number) * region.z;
#endif
    MapLevel level = level_for(area.z * cascade.z * cascade.z, finest);
    at += offset_texels(area) * (finest / cascade.z);
    vec2 local = at.xy * cascade.z + cascade.xy, inside = abs(local);
    float slope = SCALES[caster] * (abs(area.x) + abs(area.y)) / max(area.z * cascade.z, 1e-30);
    float visibility = visibility_at(local, SCALES[caster] * at.z, slope, region, level, finest);
    return max(inside.x, inside.y) < 1.0 ? visibility : 1.0;
}
#else
float directional_visibility(int i, vec3 position) {
    return 1.0;
}
#endif

#if PUNCTUAL_SHADOWS > 0
// at: position relative to the light, in the map's axes.
float perspective_visibility(vec3 at, vec3 area, vec4 region, float scale, float finest) {
    float volume = dot(area, at), inverse = 1.0 / max(at.z, 1e-6);
    float on_map = abs(volume) * inverse * inverse * inverse * scale * scale;
    MapLevel level = level_for(on_map, finest);
    area *= volume > 0.0 ? -1.0 : 1.0;
    at += offset_texels(area) * (finest * at.z / scale);
    inverse = 1.0 / max(at.z, 1e-6);
    float slope = LAMP_NEAR_M * (abs(area.x) + abs(area.y)) / (scale * max(abs(volume), 1e-30));
    return visibility_at(
        at.xy * (inverse * scale), LAMP_NEAR_M * inverse, slope, region, level, finest);
}

float punctual_visibility(int i, vec3 away, vec3 area) {
    if ((PUNCTUAL_CASTERS >> i & 1u) == 0u) return 1.0;
    int caster = DIRECTIONAL_SHADOWS + bits_below(PUNCTUAL_CASTERS, i);
    vec4 region = REGIONS[caster];
#if PLACES > 0
    if ((CUBE_CASTERS >> i & 1u) == 0u) {
        int place = DIRECTIONAL_SHADOWS + bits_below(PUNCTUAL_CASTERS & ~CUBE_CASTERS, i);
        vec3 at = PLACE(place, away + PUNCTUAL_POSITION(i));
        return perspective_visibility(
            at, cross(dFdx(at), dFdy(at)), region, SCALES[caster], TEXELS[caster]);
    }
#endif
    vec3 size = abs(away);
    bool is_z = size.z >= max(size.x, size.y), is_x = size.x >= size.y;
    // right, down and forward of the face, see lamp_views.py
    vec3 at = is_z ? away : is_x ? away.yzx : away.zxy;
    area = is_z ? area : is_x ? area.yzx : area.zxy;
    vec2 tile = vec2(is_z ? 0.0 : is_x ? 1.0 : 2.0, at.z > 0.0 ? 0.0 : 1.0);
    area.z *= at.z > 0.0 ? 1.0 : -1.0;
    at.z = abs(at.z);
    region.xy += 2.0 * tile * region.zw;
    return perspective_visibility(at, area, region, SCALES[caster], TEXELS[caster]);
}
#else
float punctual_visibility(int i, vec3 away, vec3 area) {
    return 1.0;
}
#endif

#else

vec3 surface_area(vec3 position) {
    return vec3(0.0);
}

float directional_visibility(int i, vec3 position) {
    return 1.0;
}

float punctual_visibility(int i, vec3 away, vec3 area) {
    return 1.0;
}

#endif
