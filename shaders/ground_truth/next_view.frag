// Whether the point that the ray of a pixel hits is hidden from the next viewpoint: 1, else 0. Where
// nothing is hit, what is seen is infinitely far.
#version 430 core

uniform sampler2D u_rays;           // as in surfaces.frag
uniform sampler2D u_hits_now;       // as surfaces.frag writes them
uniform usampler2D u_surfaces_now;  // likewise
uniform mat3 u_rig_from_viewpoint;       // of the next view

layout(location = 0) out uint out_hidden;

#include "ground_truth/place.glsl"
#define ANY_HIT
#include "ground_truth/surface_lookup.glsl"

// What is nearer than the point by more than this share hides it. Ranges of the same point are equal
// to 1e-6; the rest is for rays that meet a triangle too small to show in any texel.
const float NEARER = 1e-3;

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    out_hidden = 0u;
    if (texelFetch(u_rays, pixel, 0).w < 0.5) return;
    uvec2 surface = texelFetch(u_surfaces_now, pixel, 0).xy;
    vec3 there = texelFetch(u_hits_now, pixel, 0).xyz;
    float distance = INFINITE;
    if (surface.x != 0u) {
        vec4 next_from_current[3] = matrix_at(surface.x - 1u, SECOND_MATRIX);
        vec4 now = vec4(there, 1.0);
        there = vec3(dot(next_from_current[0], now), dot(next_from_current[1], now), dot(next_from_current[2], now));
        distance = length(there);
    }
    vec3 ray = normalize(there);
    bool hidden = is_hidden(place_of(u_rig_from_viewpoint * ray), ray, surface, (1.0 - NEARER) * distance);
    out_hidden = hidden ? 1u : 0u;
}
