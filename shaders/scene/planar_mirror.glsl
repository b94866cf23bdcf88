// Views in planar mirrors. A mirrored view has the atlas coordinates of the view itself.
// uint mirror_at(vec3 position, out ivec2 at): number of the mirror that a surface is in, counted
//     from 1, and the texel that shows its view; 0: no mirrored view. position: meters from the
//     viewpoint.
// vec3 mirrored_gloss(uint mirror, ivec2 at, vec3 position, vec3 normal, vec3 view,
//     float roughness, vec3 f0, float f90): light, linear RGB, that a lobe reflects toward the
//     viewpoint. Vectors are unit vectors in world axes; view is the direction toward the
//     viewpoint.
// The numbers are those of omnisim/rendering/opengl/reflect/mirror_pass.py.
// With MIRROR_GLOSS, rough lobes reflect by sampled facets, see scene/mirror_gloss.glsl.

uniform sampler2D u_mirrored;  // light; and alpha: distance in meters, negative, or 1 for the sky
uniform usampler2D u_mirror_owners;
uniform vec4 u_mirror_planes[PLANAR_MIRRORS];  // unit normal, and the viewpoint's height in meters
const float SAME_PLANE = 1e-3;  // meters, and share of the distance

bool is_own(uint mirror, vec3 position) {
    if (mirror == 0u) return false;
    vec4 plane = u_mirror_planes[mirror - 1u];
    return abs(dot(plane.xyz, position) + plane.w) <= SAME_PLANE * (1.0 + length(position));
}

uint mirror_at(vec3 position, out ivec2 at) {
    at = ivec2(gl_FragCoord.xy);
    uint mirror = texelFetch(u_mirror_owners, at, 0).r;
    if (is_own(mirror, position)) return mirror;
    // with several samples per texel, a mirror may not reach its center
    for (int side = 0; side < 9; ++side) {
        at = ivec2(gl_FragCoord.xy) + ivec2(side % 3, side / 3) - 1;
        mirror = texelFetch(u_mirror_owners, at, 0).r;
        if (is_own(mirror, position)) return mirror;
    }
    return 0u;
}

#ifdef MIRROR_GLOSS
#include "scene/mirror_gloss.glsl"
#endif

vec3 mirrored_gloss(
    uint mirror, ivec2 at, vec3 position, vec3 normal, vec3 view, float roughness, vec3 f0,
    float f90) {
#ifdef MIRROR_GLOSS
    if (roughness > MIN_ROUGHNESS)
        return sampled_gloss(mirror, at, position, normal, view, roughness, f0, f90);
#endif
    float grazing = pow(1.0 - clamp(dot(normal, view), MIN_COSINE, 1.0), 5.0);
    return mix(f0, vec3(f90), grazing) * texelFetch(u_mirrored, at, 0).rgb;
}
