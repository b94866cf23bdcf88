// Lateral chromatic aberration: each color is sampled at its own radius, bilinearly among valid
// neighbors. (The hardware's filter has weights of only 8 bits.)
#version 450 core

uniform sampler2D u_image;
uniform vec2 u_center_px;
uniform float u_inverse_radius_unit;
uniform float u_red_inverse_scale;
uniform float u_blue_inverse_scale;
uniform vec4 u_red_offsets;  // relative offsets, coefficients of powers of the relative radius
uniform vec4 u_blue_offsets;
layout(location = 0) out vec4 out_value;

float channel_at(vec2 position_px, int channel, float fallback) {
    ivec2 size = textureSize(u_image, 0);
    vec2 corner = floor(position_px);
    vec2 share = position_px - corner;
    float total = 0.0, weights = 0.0;
    for (int down = 0; down <= 1; ++down)
        for (int right = 0; right <= 1; ++right) {
            ivec2 pixel = ivec2(corner) + ivec2(right, down);
            if (any(lessThan(pixel, ivec2(0))) || any(greaterThanEqual(pixel, size)))
                continue;
            vec4 value = texelFetch(u_image, pixel, 0);
            if (value.a <= 0.5)
                continue;
            float weight = (right == 1 ? share.x : 1.0 - share.x)
                * (down == 1 ? share.y : 1.0 - share.y);
            total += weight * value[channel];
            weights += weight;
        }
    return weights > 0.0 ? total / weights : fallback;
}

float share(vec4 offsets, float radius) {
    return offsets.x + radius * (offsets.y + radius * (offsets.z + radius * offsets.w));
}

void main() {
    vec4 value = texelFetch(u_image, ivec2(gl_FragCoord.xy), 0);
    vec2 offset_px = gl_FragCoord.xy - 0.5 - u_center_px;
    float radius = length(offset_px * u_inverse_radius_unit);
    float red = u_red_inverse_scale - share(u_red_offsets, radius);
    float blue = u_blue_inverse_scale - share(u_blue_offsets, radius);
    if (value.a > 0.5) {
        value.r = channel_at(offset_px * red + u_center_px, 0, value.r);
        value.b = channel_at(offset_px * blue + u_center_px, 2, value.b);
    }
    out_value = value;
}
