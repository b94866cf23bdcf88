// Tone curve, gamma and quantization, from linear light to file values. Alpha is unchanged.
#version 450 core

uniform sampler2D u_image;
uniform sampler2D u_curve;   // points of a tone curve: light and level
uniform float u_last_point;  // index of the last point
uniform float u_exponent;    // 1/gamma; 0: sRGB; negative: tone curve
uniform float u_largest;     // largest value, 2^(bit depth) - 1
uniform float u_neutral;     // 1: neutral tone curve; 0: clipping
layout(location = 0) out vec4 out_value;
#include "common/neutral.glsl"
#include "common/srgb.glsl"

float level_of(float light) {
    int last = int(u_last_point + 0.5);
    vec2 after = texelFetch(u_curve, ivec2(0), 0).rg;
    vec2 before = after;
    for (int point = 1; point <= last && after.x <= light; ++point) {
        before = after;
        after = texelFetch(u_curve, ivec2(point, 0), 0).rg;
    }
    float share = after.x > before.x ? (light - before.x) / (after.x - before.x) : 0.0;
    return mix(before.y, after.y, clamp(share, 0.0, 1.0));
}

vec3 encode(vec3 light) {
    if (u_exponent < 0.0) {
        return vec3(level_of(light.r), level_of(light.g), level_of(light.b));
    }
    vec3 clipped = clamp(light, 0.0, 1.0);
    if (u_exponent == 0.0) {
        return srgb_from_linear(clipped);
    }
    vec3 powers = pow(max(clipped, vec3(1e-30)), vec3(u_exponent));
    return mix(powers, vec3(0.0), equal(clipped, vec3(0.0)));
}

void main() {
    vec4 value = texelFetch(u_image, ivec2(gl_FragCoord.xy), 0);
    vec3 encoded = encode(u_neutral > 0.5 ? neutral(value.rgb) : value.rgb);
    out_value = vec4(floor(encoded * u_largest + 0.5) / u_largest, value.a);
}
