// Occlusion of the point that the ray of a pixel hits, from the next viewpoint: 1, else 0. Where
// nothing is hit, the point is infinitely far.
#version 430 core

uniform sampler2D u_rays;             // unit, optical frame; and 1 where the pixel has one
uniform sampler2D u_points;           // as hits.frag writes them
uniform usampler2D u_hit_primitives;  // likewise
uniform mat3 u_rig_from_viewpoint;    // of the next pose

layout(location = 0) out uint out_occluded;

#include "ground_truth/texel.glsl"
#include "ground_truth/intersect.glsl"

// A hit nearer than the point by more than this share occludes it. Ranges of the same point are
// equal to 1e-6; the rest is for rays that meet a triangle too small to show in any texel.
const float NEARER = 1e-3;

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    out_occluded = 0u;
    if (texelFetch(u_rays, pixel, 0).w < 0.5) return;
    uvec2 primitive = texelFetch(u_hit_primitives, pixel, 0).xy;
    vec3 point = texelFetch(u_points, pixel, 0).xyz;
    float range = INFINITE;
    if (primitive.x != 0u) {
        point = transformed(matrix_at(primitive.x - 1u, SECOND_MATRIX), vec4(point, 1.0));
        range = length(point);
    }
    vec3 ray = normalize(point);
    vec3 texel = texel_of_ray(u_rig_from_viewpoint * ray);
    out_occluded = occluded(texel, ray, primitive, (1.0 - NEARER) * range) ? 1u : 0u;
}
