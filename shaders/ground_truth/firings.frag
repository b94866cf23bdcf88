// Hit of each laser's beam: 1 + draw item, range as bits of a float, and triangle in the draw item;
// 0: no hit.
// Lidar and objects move during the revolution. A draw item has two matrices, relative to the
// lidar's origin at the start and at the end of a slice. A firing interpolates between them by its
// time, so triangles are intersected at their poses at the firing. The atlas, drawn in the middle
// of the slice, only selects candidates.
#version 450 core

uniform sampler2D u_rays;  // unit direction, world axes; and the firing's time in its slice, 0 to 1
uniform mat3 u_rig_from_viewpoint;
uniform vec3 u_path_m;  // motion of the lidar's origin from the slice's start to its end

layout(location = 0) out uvec4 out_hit;

#define SLICE
float slice_share;
const vec3 ray_origin = vec3(0.0);
#include "ground_truth/texel.glsl"
#include "ground_truth/intersect.glsl"

void main() {
    vec4 firing = texelFetch(u_rays, ivec2(gl_FragCoord.xy), 0);
    vec3 ray = firing.xyz;
    slice_share = firing.w;
    vec3 texel = texel_of_ray(u_rig_from_viewpoint * ray);
    Hit hit = intersect(texel, ray);
    // the hit point, relative to the middle of the slice
    vec3 offset = (slice_share - 0.5) * u_path_m;
    if (hit.primitive.x != 0u && dot(offset, offset) > 0.0) {
        vec3 moved = texel_of_ray(u_rig_from_viewpoint * normalize(hit.range * ray + offset));
        if (floor(moved.xy) != floor(texel.xy)) {
            Hit again = intersect(moved, ray);
            if (again.primitive.x != 0u) hit = again;
        }
    }
    out_hit = uvec4(hit.primitive.x, floatBitsToUint(hit.range), hit.primitive.y, 0u);
}
