// Hit of each pixel's ray: point, range, primitive; with NORMALS the interpolated normal, with
// ALBEDO the base color, with MATERIALS roughness, metalness and emission. With PARALLAX rays have origins of their own, and the triangles are those
// that the viewpoint sees where the ray ends, by depth (first_surface.glsl). With BATCH there are
// images below each other.
#version 450 core

uniform sampler2D u_rays;  // unit, optical frame; and 1 where the pixel has one
#ifdef BATCH
flat in int v_image;
#else
uniform mat3 u_viewpoint_from_optical;
#endif

// Viewpoint frame; and range. Infinite: nothing is hit, and the point is a direction.
layout(location = 0) out vec4 out_point;
layout(location = 1) out uvec2 out_primitive;  // 1 + draw item, and triangle in it; 0: nothing
// With PARALLAX also UNKNOWN: the viewpoint does not see where the ray ends.
#ifdef NORMALS
#include "scene/vertex_words.glsl"
layout(location = 2) out vec4 out_normal;  // viewpoint frame, unit
#define ALBEDO_LOCATION 3
#else
#define ALBEDO_LOCATION 2
#endif
#ifdef PARALLAX
#define GUESS
#include "capture/first_surface.glsl"
uniform sampler2D u_origins;  // of the rays, from the viewpoint, optical frame
uniform mat3 u_rig_from_optical;
const uint UNKNOWN = 0x80000000u;  // of the draw item's bits
const int ROUNDS = 3;
const float IN_FRONT = 1.005;  // inverse depths this much larger are not of the same plane
#else
#include "ground_truth/texel.glsl"
#endif
#include "ground_truth/intersect.glsl"
#if defined(ALBEDO) || defined(MATERIALS)
#include "ground_truth/nearest_texel.glsl"
#ifdef BATCH
#define ATLAS sampler2DArray
#define value_at(atlas, texel) texelFetch(atlas, ivec3(texel, v_image), 0)
#else
#define ATLAS sampler2D
#define value_at(atlas, texel) texelFetch(atlas, texel, 0)
#endif
#endif
#ifdef ALBEDO
uniform ATLAS u_albedos;
layout(location = ALBEDO_LOCATION) out vec4 out_albedo;
#endif
#ifdef MATERIALS
uniform ATLAS u_gloss;  // as visibility.frag writes them
uniform ATLAS u_emission;
#if defined(NORMALS) && defined(ALBEDO)
layout(location = 4) out vec4 out_gloss;
layout(location = 5) out vec4 out_emission;
#elif defined(NORMALS) || defined(ALBEDO)
layout(location = 3) out vec4 out_gloss;
layout(location = 4) out vec4 out_emission;
#else
layout(location = 2) out vec4 out_gloss;
layout(location = 3) out vec4 out_emission;
#endif
#endif

#ifdef BATCH
mat3 viewpoint_from_optical() {
    vec4 rows[3] = matrix_at(u_draw_item_count - 1u, VIEWPOINT_FROM_MESH);
    return transpose(mat3(rows[0].xyz, rows[1].xyz, rows[2].xyz));
}

ivec2 pixel() {
    return ivec2(gl_FragCoord.xy) - ivec2(0, v_image * textureSize(u_rays, 0).y);
}
#else
mat3 viewpoint_from_optical() {
    return u_viewpoint_from_optical;
}

ivec2 pixel() {
    return ivec2(gl_FragCoord.xy);
}
#endif

#ifdef NORMALS
// As scene/surface.frag has it: the interpolated normal, or the plane's, of the side that is seen.
vec3 normal_of(Hit hit) {
    uint item = hit.primitive.x - 1u;
    uint first = draw_item_at(item).x + 3u * hit.primitive.y;
    // of any length: the weights need not be normalized
    vec3 mesh = hit.weights.x * normal_at(vertex_at(first)) +
                hit.weights.y * normal_at(vertex_at(first + 1u)) +
                hit.weights.z * normal_at(vertex_at(first + 2u));
    vec4 normal_from_mesh[3] = matrix_at(item, SECOND_MATRIX);
    vec3 smooth_normal = vec3(
        dot(normal_from_mesh[0].xyz, mesh),
        dot(normal_from_mesh[1].xyz, mesh),
        dot(normal_from_mesh[2].xyz, mesh));
    vec3 normal = dot(smooth_normal, smooth_normal) > 0.0 ? smooth_normal : hit.normal;
    return normalize(normal * (dot(normal, hit.normal) < 0.0 ? -1.0 : 1.0));
}
#endif

#ifdef PARALLAX
struct Ending {
    Hit hit;
    vec3 texel;
    bool known;
};

// Tells whether a texel around shows something in front of the plane that is hit: it may reach as far
// as the ray, too thin to show there.
bool is_beside_nearer(Hit hit, Place place, vec3 ray) {
    vec3 normal = u_face_from_rig[place.face] * u_rig_from_optical *
        (transpose(viewpoint_from_optical()) * hit.normal);
    float scale = hit.primitive.x == 0u ? 0.0 :
        1.0 / dot(hit.normal, ray_origin + hit.range * ray);
    bool found = false;
    for (uint at = 0u; at < TEXELS; ++at) {
        vec2 texel = floor(place.texel) + 0.5 + vec2(texel_offset(at));
        vec2 tangent = (texel - place.cell.xy) / place.cell.zw;
        float of_plane = max(scale * dot(normal, vec3(tangent, 1.0)), 0.0);
        found = found || inverse_z_at(texel) > IN_FRONT * of_plane;
    }
    return found;
}

// The depth of texels tells the end but for a texel, triangles tell it exactly. A ray that passes
// just beside what a texel shows goes on.
Ending follow(vec3 rig, vec3 rig_origin, vec3 ray) {
    Ending ending;
    ending.known = false;
    float start = u_nearest;
    float depth = max(max(abs(rig.x), abs(rig.y)), abs(rig.z));  // planes are those of its origin
    bool goes_on = true;
    for (int round = 0; round < ROUNDS && goes_on; ++round) {
        FirstSurface found = first_surface(rig, rig_origin, start);
        Place place = place_of(rig + found.nearness * rig_origin, rig_origin);
        ending.texel = vec3(place.texel, depth);
        ending.hit = intersect(ending.texel, ray);
        float nearness = ending.hit.primitive.x == 0u ? 0.0 : 1.0 / ending.hit.range;
        bool is_there = (found.nearness - nearness) * place.texels < STEP_TEXELS;
        ending.known = found.known && is_there && !ending.hit.beside &&
            !is_beside_nearer(ending.hit, place, ray);
        goes_on = found.known && !is_there;
        start = found.nearness - STEP_TEXELS / place.texels;
    }
    return ending;
}
#endif

void main() {
    vec4 optical = texelFetch(u_rays, pixel(), 0);
    vec3 ray = viewpoint_from_optical() * optical.xyz;
    out_point = vec4(ray, INFINITE);
    out_primitive = uvec2(0u);
#ifdef NORMALS
    out_normal = vec4(0.0);
#endif
#ifdef ALBEDO
    out_albedo = vec4(0.0);
#endif
#ifdef MATERIALS
    out_gloss = out_emission = vec4(0.0);
#endif
    if (optical.w < 0.5) return;
#ifdef PARALLAX
    vec3 optical_origin = texelFetch(u_origins, pixel(), 0).xyz;
    vec3 rig = u_rig_from_optical * optical.xyz, rig_origin = u_rig_from_optical * optical_origin;
    ray_origin = viewpoint_from_optical() * optical_origin;
    Ending ending = follow(rig, rig_origin, ray);
    vec3 texel = ending.texel;
    Hit hit = ending.hit;
    uint unknown = ending.known ? 0u : UNKNOWN;
    vec3 start = ray_origin;
#else
    vec3 texel = texel_of_ray(u_rig_from_optical * optical.xyz);
    Hit hit = intersect(texel, ray);
    const uint unknown = 0u;
    const vec3 start = vec3(0.0);
#endif
    out_primitive.x = unknown;
    if (hit.primitive.x == 0u) return;
    out_point = vec4(start + hit.range * ray, hit.range);
    out_primitive = uvec2(hit.primitive.x | unknown, hit.primitive.y);
#ifdef NORMALS
    out_normal = vec4(normal_of(hit), 1.0);
#endif
#if defined(ALBEDO) || defined(MATERIALS)
    ivec2 nearest = nearest_texel(texel, hit);
#endif
#ifdef ALBEDO
    vec3 root = value_at(u_albedos, nearest).rgb;
    out_albedo = vec4(root * root, 1.0);
#endif
#ifdef MATERIALS
    out_gloss = value_at(u_gloss, nearest);
    out_emission = value_at(u_emission, nearest);
#endif
}
