// Environment map behind all surfaces.
#version 450 core

in vec3 v_direction;
layout(location = 0) out vec4 out_color;
uniform sampler2D u_sky;

#include "scene/sky_coordinates.glsl"

void main() {
    vec3 direction = normalize(v_direction);
    // mip level from the angle, because texture coordinates jump at the map's seam
    float radians = max(length(dFdx(direction)), length(dFdy(direction)));
    float texel = 0.5 * TURN / float(textureSize(u_sky, 0).y);
    float level = radians > texel ? log2(radians / texel) : 0.0;
    out_color = vec4(textureLod(u_sky, sky_coordinates(direction), level).rgb, 1.0);
}
