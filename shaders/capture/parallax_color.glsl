// vec3 color_at(vec2 texel, float level): linear colour of the atlas at a position in it.

uniform sampler2D u_atlas;
uniform vec2 u_atlas_px;

vec3 color_at(vec2 texel, float level) {
#ifdef MIP_LEVELS
    return textureLod(u_atlas, texel / u_atlas_px, level).rgb;
#else
    return texture(u_atlas, texel / u_atlas_px).rgb;  // has no levels, and is quicker so
#endif
}
