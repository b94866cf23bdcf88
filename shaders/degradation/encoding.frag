// Tone curve, gamma and quantization, from linear light to the values of the file. Alpha is kept.
#version 450 core

uniform sampler2D u_image;
uniform float u_exponent;  // 1/gamma; 0: sRGB
uniform float u_largest;   // 2 to the power of the bit depth, less 1
layout(location = 0) out vec4 out_value;
uniform float u_neutral;   // 1: by the neutral tone curve; 0: clipped
#include "common/neutral.glsl"
#include "common/srgb.glsl"

void main() {
    vec4 value = texelFetch(u_image, ivec2(gl_FragCoord.xy), 0);
    vec3 linear = clamp(u_neutral > 0.5 ? neutral(value.rgb) : value.rgb, 0.0, 1.0);
    vec3 encoded = u_exponent == 0.0
        ? srgb_from_linear(linear)
        : mix(pow(max(linear, vec3(1e-30)), vec3(u_exponent)), vec3(0.0), equal(linear, vec3(0.0)));
    out_value = vec4(floor(encoded * u_largest + 0.5) / u_largest, value.a);
}
