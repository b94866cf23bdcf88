// From the linear picture to 8 bits of sRGB; alpha is kept.
#version 430 core

uniform sampler2D u_linear;
layout(location = 0) out vec4 out_color;
#include "common/srgb.glsl"

void main() {
    vec4 value = texelFetch(u_linear, ivec2(gl_FragCoord.xy), 0);
    out_color = vec4(srgb_from_linear(clamp(value.rgb, 0.0, 1.0)), value.a);
}
