// vec3 color_at(vec2 texel, float level): linear color of the atlas at a position in it.

// vec3 color_along(vec3 color, vec3 toward, float nearness, vec3 aside): a color of the atlas as a ray
// from beside the viewpoint sees it; with FOG through more or less of it. toward over nearness is the
// place that is seen, aside the ray's origin, both from the viewpoint.

#ifdef FOG
#include "scene/fog.glsl"
#endif
uniform sampler2D u_atlas;
uniform vec2 u_atlas_px;

vec3 color_at(vec2 texel, float level) {
#ifdef MIP_LEVELS
    return textureLod(u_atlas, texel / u_atlas_px, level).rgb;
#else
    return texture(u_atlas, texel / u_atlas_px).rgb;  // has no levels, and is quicker so
#endif
}

vec3 color_along(vec3 color, vec3 toward, float nearness, vec3 aside) {
#ifdef FOG
    // the difference of the two distances, also where they are infinite
    vec3 along = toward - nearness * aside;
    float more_m = (nearness * dot(aside, aside) - 2.0 * dot(toward, aside))
        / (length(along) + length(toward));
    return fogged(color, more_m);
#else
    return color;
#endif
}
