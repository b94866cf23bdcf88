// Bayer mosaic: each pixel has the color of its filter in all three channels.
#version 450 core

uniform sampler2D u_image;
#include "degradation/bayer_pattern.glsl"
layout(location = 0) out vec4 out_value;

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    vec4 value = texelFetch(u_image, pixel, 0);
    out_value = vec4(vec3(value[color_of(pixel)]), value.a);
}
