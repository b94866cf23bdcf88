// Samples of a camera whose rays do not meet in one point, from the atlas of one viewpoint.
// A ray (o, q) meets its surface at s: that is where the viewpoint, at 0, sees it along o + s q. From
// s = ∞ on, the range t(d) along d = o + s q is looked up, and s = (t d − o)·q, until d stays.
// Where it does not, or where the viewpoint does not see some point of the ray before s, behind which
// another surface may be, the sample is undecided.
// With LEVELS, which is drawn once: mip levels of the rays beside their origins.
#version 430 core

uniform sampler2D u_rays;     // unit, rig frame; and 1 where the sample has one
uniform sampler2D u_origins;  // of the rays, from the viewpoint, rig frame; and mip level
uniform sampler2D u_atlas;
uniform sampler2D u_depth;    // of the atlas's texels
uniform vec2 u_depth_from_inverse_z;  // depth = x + y / z
uniform float u_near_m;
uniform float u_tolerance_rad;  // d stays if it moves by less

#include "capture/rig_uv.glsl"

layout(location = 0) out vec4 out_color;
layout(location = 1) out float out_undecided;

const int STEPS = 6;
// shares of the way to the surface
const float PLACES[] = float[](0.97, 0.92, 0.85, 0.75, 0.65, 0.55, 0.45, 0.35, 0.28, 0.2);
const float HIDDEN = 0.995;  // a surface nearer than this share of a place's range hides it
const float NOTHING_M = 1e9;
const float FAR_M = 100.0;  // way that is looked along where nothing is met

float range_m(vec3 rig) {
    vec3 local = u_face_from_rig[face_of(rig)] * rig;
    ivec2 texel = ivec2(uv_of(rig) * vec2(textureSize(u_depth, 0)));
    float depth = texelFetch(u_depth, texel, 0).r;
    if (depth <= 0.0) return NOTHING_M;
    float z = u_depth_from_inverse_z.y / (depth - u_depth_from_inverse_z.x);
    return z * length(local) / local.z;
}

bool is_hidden(vec3 place) {
    float range = length(place);
    return range_m(place / range) < HIDDEN * range;
}

// From a sample to the next, or from the one before where the next one has no ray.
vec3 step_along(ivec2 pixel, ivec2 way, vec3 ray) {
    vec4 next = texelFetch(u_rays, pixel + way, 0), last = texelFetch(u_rays, pixel - way, 0);
    return next.w > 0.5 ? next.xyz - ray : last.w > 0.5 ? ray - last.xyz : vec3(0.0);
}

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    vec4 ray = texelFetch(u_rays, pixel, 0);
    vec4 start = texelFetch(u_origins, pixel, 0);
    vec3 origin = start.xyz;
    out_color = vec4(0.0);
    out_undecided = 0.0;
    if (ray.w < 0.5) return;
#ifdef LEVELS
    // of the rays, which are smooth: what they meet is not
    vec3 right = step_along(pixel, ivec2(1, 0), ray.xyz);
    out_color = vec4(origin, level_of(ray.xyz, right, step_along(pixel, ivec2(0, 1), ray.xyz)));
    return;
#endif
    vec3 direction = ray.xyz;
    float moved = 1.0, length_m = FAR_M;
    for (int i = 0; i < STEPS && moved > u_tolerance_rad; ++i) {
        float range = range_m(direction);
        vec3 next = ray.xyz;
        length_m = FAR_M;
        if (range < NOTHING_M) {
            length_m = max(dot(range * direction - origin, ray.xyz), u_near_m);
            next = normalize(origin + length_m * ray.xyz);
        }
        moved = distance(next, direction);
        direction = next;
    }
    out_color = vec4(textureLod(u_atlas, uv_of(direction), start.w).rgb, 1.0);
    bool undecided = moved > u_tolerance_rad;
    // places that are seen within a texel of the surface need no look-up
    float aside = length(cross(origin, ray.xyz)) / length_m;
    for (int i = 0; i < PLACES.length() && !undecided; ++i)
        if (aside * (1.0 / PLACES[i] - 1.0) > u_tolerance_rad)
            undecided = is_hidden(origin + PLACES[i] * length_m * ray.xyz);
    out_undecided = undecided ? 1.0 : 0.0;
}
