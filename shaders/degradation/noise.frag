// Shot noise, dark current, fixed pattern, read noise and A/D conversion, per pixel and color.
// Names and units are those of omnisim/rendering/camera/degradations/noise.py, which names the
// sources.
#version 450 core

uniform sampler2D u_image;
uniform sampler2D u_pattern;  // deviations of gain and dark signal; a single texel: no pattern
uniform uint u_key;
uniform uint u_frame;
uniform float u_white_e;
uniform float u_full_well_e;
uniform float u_gain_e_per_dn;
uniform float u_read_noise_e;
uniform float u_dark_e;
uniform float u_black_level_dn;
uniform float u_largest_dn;
uniform float u_normal_from_e;
uniform int u_most_counted;
uniform float u_smallest_term;
#include "common/random.glsl"
layout(location = 0) out vec4 out_value;

// Inverse of the Poisson distribution's cumulative distribution function.
float poisson_quantile(float mean, float probability) {
    float term = exp(-mean), total = term, count = 0.0;
    for (int number = 1; number < u_most_counted; ++number) {
        bool at_end = float(number) > mean && term < u_smallest_term;
        if (probability <= total || at_end)
            break;
        term *= mean / float(number);
        total += term;
        count = float(number);
    }
    return count;
}

float poisson(float mean, uint first, uint second) {
    if (mean < u_normal_from_e)
        return poisson_quantile(mean, uniform_number(first));
    float z = normal_number(first, second);
    return max(floor(mean + sqrt(mean) * z + (z * z - 1.0) / 6.0 + 0.5), 0.0);
}

void main() {
    uvec2 pixel = uvec2(gl_FragCoord.xy);
    vec4 value = texelFetch(u_image, ivec2(pixel), 0);
    vec2 pattern = texelFetch(u_pattern, min(ivec2(pixel), textureSize(u_pattern, 0) - 1), 0).rg;
    for (int channel = 0; channel < 3 && value.a > 0.5; ++channel) {
        uvec4 hash = pcg4d(uvec4(pixel, u_frame, u_key + uint(channel)));
        float mean_e = max(value[channel], 0.0) * u_white_e * (1.0 + pattern.x) + u_dark_e;
        float electrons = min(poisson(mean_e, hash.x, hash.y), u_full_well_e);
        electrons += pattern.y;
        electrons += u_read_noise_e * normal_number(hash.z, hash.w);
        float number = floor(electrons / u_gain_e_per_dn + u_black_level_dn + 0.5);
        number = clamp(number, 0.0, u_largest_dn);
        value[channel] = ((number - u_black_level_dn) * u_gain_e_per_dn - u_dark_e) / u_white_e;
    }
    out_value = value;
}
