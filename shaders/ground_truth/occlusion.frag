// Occlusion, seen from the next viewpoint, of the point that a pixel's ray hits: 1 occluded, 0
// visible. Without a hit, the point is infinitely far.
// With PARTS, the atlas shows a part of the image, and other points are left to other parts.
#version 450 core

const vec3 ray_origin = vec3(0.0);
#include "ground_truth/texel.glsl"
#include "ground_truth/intersect.glsl"
#include "ground_truth/occluding.glsl"

#ifdef PARTS
bool is_of_another_part(vec3 ray) { return !is_drawn(ray); }
#else
bool is_of_another_part(vec3 ray) { return false; }
#endif

void main() {
    uvec2 primitive;
    vec3 point;
    out_occluded = 0u;
    if (!point_of(ivec2(gl_FragCoord.xy), primitive, point)) return;
    float range = primitive.x != 0u ? length(point) : INFINITE;
    vec3 ray = normalize(point);
    if (is_of_another_part(u_rig_from_viewpoint * ray)) discard;
    vec3 texel = texel_of_ray(u_rig_from_viewpoint * ray);
    out_occluded = occluded(texel, ray, primitive, (1.0 - NEARER) * range) ? 1u : 0u;
}
