// What the ray of a pixel hits: where, which triangle of which draw; with NORMALS how it is turned,
// with ALBEDO its plain colour.
#version 430 core

uniform sampler2D u_rays;    // unit, optical frame; and 1 where the pixel has one
uniform sampler2D u_places;  // as places.frag writes them
uniform mat3 u_viewpoint_from_optical;

layout(location = 0) out vec4 out_hit;       // here; range, infinite: nothing is hit, but in that direction
layout(location = 1) out uvec2 out_surface;  // 1 + number of the draw, number of its triangle; 0: nothing
#ifdef NORMALS
#include "scene/vertex_words.glsl"
layout(location = 2) out vec4 out_normal;  // here, unit
#define ALBEDO_LOCATION 3
#else
#define ALBEDO_LOCATION 2
#endif
#ifdef ALBEDO
uniform sampler2D u_albedos;
layout(location = ALBEDO_LOCATION) out vec4 out_albedo;
#endif

#include "ground_truth/surface_lookup.glsl"

#ifdef NORMALS
// As scene/surface.frag has it: the interpolated normal, or the plane's, of the side that is seen.
vec3 normal_of(Found hit) {
    uint first = draw_at(hit.surface.x - 1u).x + 3u * hit.surface.y;
    // of any length: the weights need not be normalised
    vec3 mesh = hit.weights.x * normal_at(vertex_at(first)) +
                hit.weights.y * normal_at(vertex_at(first + 1u)) +
                hit.weights.z * normal_at(vertex_at(first + 2u));
    vec4 normal_from_mesh[3] = matrix_at(hit.surface.x - 1u, SECOND_MATRIX);
    vec3 smooth_normal = vec3(
        dot(normal_from_mesh[0].xyz, mesh),
        dot(normal_from_mesh[1].xyz, mesh),
        dot(normal_from_mesh[2].xyz, mesh));
    vec3 normal = dot(smooth_normal, smooth_normal) > 0.0 ? smooth_normal : hit.normal;
    return normalize(normal * (dot(normal, hit.normal) < 0.0 ? -1.0 : 1.0));
}
#endif

void main() {
    vec4 ray = texelFetch(u_rays, ivec2(gl_FragCoord.xy), 0);
    vec3 here = u_viewpoint_from_optical * ray.xyz;
    out_hit = vec4(here, INFINITE);
    out_surface = uvec2(0u);
#ifdef NORMALS
    out_normal = vec4(0.0);
#endif
#ifdef ALBEDO
    out_albedo = vec4(0.0);
#endif
    if (ray.w < 0.5) return;
    Found hit = look_up(texelFetch(u_places, ivec2(gl_FragCoord.xy), 0).xyz, here);
    if (hit.surface.x == 0u) return;
    out_hit = vec4(hit.range * here, hit.range);
    out_surface = hit.surface;
#ifdef NORMALS
    out_normal = vec4(normal_of(hit), 1.0);
#endif
#ifdef ALBEDO
    vec3 root = texelFetch(u_albedos, hit.texel, 0).rgb;
    out_albedo = vec4(root * root, 1.0);
#endif
}
