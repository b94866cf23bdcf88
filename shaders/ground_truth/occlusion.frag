// Occlusion of the point that the ray of a pixel hits, from the next viewpoint: 1, else 0. Where
// nothing is hit, the point is infinitely far.
// With PARALLAX from the origin of the ray that shows the point then; UNKNOWN is added where the
// viewpoint does not see all of that ray.
#version 450 core

uniform sampler2D u_rays;             // unit, optical frame; and 1 where the pixel has one
uniform sampler2D u_points;           // as hits.frag writes them
uniform usampler2D u_hit_primitives;  // likewise
uniform mat3 u_rig_from_viewpoint;    // of the next pose

layout(location = 0) out uint out_occluded;

#ifdef PARALLAX
#define GUESS
#include "capture/first_surface.glsl"
uniform sampler2D u_origins;  // from the next viewpoint, in its frame
const uint UNKNOWN = 2u;
const uint ITEM_BITS = 0x7FFFFFFFu;
const int ROUNDS = 3;
#else
#include "ground_truth/texel.glsl"
const uint ITEM_BITS = 0xFFFFFFFFu;
#endif
#include "ground_truth/intersect.glsl"

// A hit nearer than the point by more than this share occludes it. Ranges of the same point are
// equal to 1e-6; the rest is for rays that meet a triangle too small to show in any texel.
const float NEARER = 1e-3;

#ifdef PARALLAX
// As hits.frag follows a ray, until it is occluded or has reached the point.
uint follow(vec3 ray, uvec2 primitive, float range) {
    vec3 rig = u_rig_from_viewpoint * ray, rig_origin = u_rig_from_viewpoint * ray_origin;
    float depth = max(max(abs(rig.x), abs(rig.y)), abs(rig.z));
    float start = u_nearest;
    bool goes_on = true, known = false, is_occluded = false;
    for (int round = 0; round < ROUNDS && goes_on; ++round) {
        FirstSurface found = first_surface(rig, rig_origin, start);
        Place place = place_of(rig + found.nearness * rig_origin, rig_origin);
        vec3 texel = vec3(place.texel, depth);
        is_occluded = occluded(texel, ray, primitive, (1.0 - NEARER) * range);
        bool reaches = (found.nearness - 1.0 / range) * place.texels < STEP_TEXELS;
        known = found.known && (is_occluded || reaches);
        goes_on = found.known && !known;
        start = found.nearness - STEP_TEXELS / place.texels;
    }
    return (is_occluded ? 1u : 0u) + (known ? 0u : UNKNOWN);
}
#endif

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    out_occluded = 0u;
    if (texelFetch(u_rays, pixel, 0).w < 0.5) return;
    uvec2 primitive = texelFetch(u_hit_primitives, pixel, 0).xy;
    primitive.x &= ITEM_BITS;
    vec3 point = texelFetch(u_points, pixel, 0).xyz;
    if (primitive.x != 0u)
        point = transformed(matrix_at(primitive.x - 1u, SECOND_MATRIX), vec4(point, 1.0));
#ifdef PARALLAX
    ray_origin = texelFetch(u_origins, pixel, 0).xyz;
    if (primitive.x != 0u) point -= ray_origin;
#endif
    float range = primitive.x != 0u ? length(point) : INFINITE;
    vec3 ray = normalize(point);
#ifdef PARALLAX
    out_occluded = follow(ray, primitive, range);
#else
    vec3 texel = texel_of_ray(u_rig_from_viewpoint * ray);
    out_occluded = occluded(texel, ray, primitive, (1.0 - NEARER) * range) ? 1u : 0u;
#endif
}
