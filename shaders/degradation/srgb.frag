// Encoding of linear light in sRGB, as in an ideal camera. Alpha is unchanged.
#version 450 core

uniform sampler2D u_image;
layout(location = 0) out vec4 out_value;
#include "common/srgb.glsl"

void main() {
    vec4 value = texelFetch(u_image, ivec2(gl_FragCoord.xy), 0);
    out_value = vec4(srgb_from_linear(clamp(value.rgb, 0.0, 1.0)), value.a);
}
