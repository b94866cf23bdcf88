// Hit of each pixel's ray: point, range, primitive; with NORMALS the interpolated normal, with
// ALBEDO the base colour.
#version 430 core

uniform sampler2D u_rays;  // unit, optical frame; and 1 where the pixel has one
uniform mat3 u_viewpoint_from_optical;

// Viewpoint frame; and range. Infinite: nothing is hit, and the point is a direction.
layout(location = 0) out vec4 out_point;
layout(location = 1) out uvec2 out_primitive;  // 1 + draw item, and triangle in it; 0: nothing
#ifdef NORMALS
#include "scene/vertex_words.glsl"
layout(location = 2) out vec4 out_normal;  // viewpoint frame, unit
#define ALBEDO_LOCATION 3
#else
#define ALBEDO_LOCATION 2
#endif
#include "ground_truth/texel.glsl"
#include "ground_truth/intersect.glsl"
#ifdef ALBEDO
#include "ground_truth/nearest_texel.glsl"
uniform sampler2D u_albedos;
layout(location = ALBEDO_LOCATION) out vec4 out_albedo;
#endif

#ifdef NORMALS
// As scene/surface.frag has it: the interpolated normal, or the plane's, of the side that is seen.
vec3 normal_of(Hit hit) {
    uint item = hit.primitive.x - 1u;
    uint first = draw_item_at(item).x + 3u * hit.primitive.y;
    // of any length: the weights need not be normalised
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

void main() {
    vec4 optical = texelFetch(u_rays, ivec2(gl_FragCoord.xy), 0);
    vec3 ray = u_viewpoint_from_optical * optical.xyz;
    out_point = vec4(ray, INFINITE);
    out_primitive = uvec2(0u);
#ifdef NORMALS
    out_normal = vec4(0.0);
#endif
#ifdef ALBEDO
    out_albedo = vec4(0.0);
#endif
    if (optical.w < 0.5) return;
    vec3 texel = texel_of_ray(u_rig_from_optical * optical.xyz);
    Hit hit = intersect(texel, ray);
    if (hit.primitive.x == 0u) return;
    out_point = vec4(hit.range * ray, hit.range);
    out_primitive = hit.primitive;
#ifdef NORMALS
    out_normal = vec4(normal_of(hit), 1.0);
#endif
#ifdef ALBEDO
    vec3 root = texelFetch(u_albedos, nearest_texel(texel, hit), 0).rgb;
    out_albedo = vec4(root * root, 1.0);
#endif
}
