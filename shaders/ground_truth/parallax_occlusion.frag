// Occlusion as in occlusion.frag, between the ray's origin and the point, both at the next pose.
// UNKNOWN is added if the viewpoint does not see the whole ray.
#version 450 core

vec3 ray_origin = vec3(0.0);  // frame of the next viewpoint
#define GUESS
#include "capture/first_surface.glsl"
#include "ground_truth/intersect.glsl"
#include "ground_truth/occluding.glsl"

uniform sampler2D u_origins;  // ray origins, frame of the next viewpoint
const uint UNKNOWN = 2u;
const int ROUNDS = 3;

// Follows a ray as in parallax_hits.frag, until it is occluded or reaches the point.
uint follow(vec3 ray, uvec2 primitive, float range) {
    vec3 rig = u_rig_from_viewpoint * ray, rig_origin = u_rig_from_viewpoint * ray_origin;
    float depth = max(max(abs(rig.x), abs(rig.y)), abs(rig.z));
    float start = largest_nearness();
    bool continues = true, known = false, is_occluded = false;
    for (int round = 0; round < ROUNDS && continues; ++round) {
        FirstSurface found = first_surface(rig, rig_origin, start);
        Place place = place_of(rig + found.nearness * rig_origin, rig_origin);
        vec3 texel = vec3(place.texel, depth);
        is_occluded = occluded(texel, ray, primitive, (1.0 - NEARER) * range);
        bool reaches = (found.nearness - 1.0 / range) * place.texels < STEP_TEXELS;
        known = found.known && (is_occluded || reaches);
        continues = found.known && !known;
        start = found.nearness - STEP_TEXELS / place.texels;
    }
    return (is_occluded ? 1u : 0u) + (known ? 0u : UNKNOWN);
}

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    uvec2 primitive;
    vec3 point;
    out_occluded = 0u;
    if (!point_of(pixel, primitive, point)) return;
    ray_origin = texelFetch(u_origins, pixel, 0).xyz;
    if (primitive.x != 0u) point -= ray_origin;
    float range = primitive.x != 0u ? length(point) : INFINITE;
    out_occluded = follow(normalize(point), primitive, range);
}
