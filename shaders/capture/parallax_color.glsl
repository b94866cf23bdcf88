// vec3 color_at(vec2 texel, float level): linear color of the atlas at a texel position.
// vec3 color_along(vec3 color, vec3 toward, float nearness, vec3 aside): color of the atlas as seen
//     along a ray from beside the viewpoint; with FOG, for the ray's own distance. The seen point
//     is toward / nearness, and the ray's origin is aside, both relative to the viewpoint.

#include "scene/fog.glsl"
uniform sampler2D u_atlas;
uniform vec2 u_atlas_px;

vec3 color_at(vec2 texel, float level) {
#ifdef MIP_LEVELS
    return textureLod(u_atlas, texel / u_atlas_px, level).rgb;
#else
    return texture(u_atlas, texel / u_atlas_px).rgb;  // faster than textureLod, without mip levels
#endif
}

vec3 color_along(vec3 color, vec3 toward, float nearness, vec3 aside) {
    // difference of the two distances, finite even for points at infinity
    vec3 along = toward - nearness * aside;
    float more_m = (nearness * dot(aside, aside) - 2.0 * dot(toward, aside))
        / (length(along) + length(toward));
    return fogged(color, more_m);
}
