// Hit of each pixel's ray, which starts at the viewpoint.
#version 450 core

#ifdef BATCH
flat in int v_image;
#endif
const vec3 ray_origin = vec3(0.0);
#include "ground_truth/texel.glsl"
#include "ground_truth/intersect.glsl"
#include "ground_truth/pixel_rays.glsl"
#include "ground_truth/hit_outputs.glsl"

void main() {
    vec4 optical = texelFetch(u_rays, pixel(), 0);
    vec3 ray = viewpoint_from_optical() * optical.xyz;
    write_nothing(ray);
    if (optical.w < 0.5) return;
    vec3 texel = texel_of_ray(u_rig_from_optical * optical.xyz);
    Hit hit = intersect(texel, ray);
    if (hit.primitive.x != 0u) write_hit(ray, ray_origin, texel, hit);
}
