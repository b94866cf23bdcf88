// Defocus: mean of the valid pixels in a disc whose radius grows toward the rim.
#version 450 core

uniform sampler2D u_image;
uniform float u_center_defocus_px;
uniform float u_rim_defocus_px;
uniform vec2 u_limits_px;  // minimum and maximum radius
uniform int u_strips;      // strips per pixel on the disc's edge
#include "degradation/squared_radius.glsl"
layout(location = 0) out vec4 out_value;

// Share of a pixel inside the disc around another pixel: numerical integration over strips, with
// the exact chord in each strip.
float covered_share(vec2 offset_px, float radius_px) {
    float away = length(offset_px);
    if (abs(away - radius_px) > 0.7072)  // beyond the distance from a pixel's middle to its corner
        return away < radius_px ? 1.0 : 0.0;
    float far = max(abs(offset_px.x), abs(offset_px.y));
    float near = min(abs(offset_px.x), abs(offset_px.y));
    float share = 0.0;
    for (int strip = 0; strip < u_strips; ++strip) {
        float across = near + (float(strip) + 0.5) / float(u_strips) - 0.5;
        float chord = sqrt(max(radius_px * radius_px - across * across, 0.0));
        share += max(min(far + 0.5, chord) - max(far - 0.5, -chord), 0.0);
    }
    return share / float(u_strips);
}

void main() {
    ivec2 middle = ivec2(gl_FragCoord.xy);
    vec4 own = texelFetch(u_image, middle, 0);
    float radius_px = clamp(
        u_center_defocus_px + (u_rim_defocus_px - u_center_defocus_px) *
            squared_radius(gl_FragCoord.xy - 0.5),
        u_limits_px.x, u_limits_px.y);
    int reach = int(ceil(radius_px + 0.5));
    ivec2 first = max(middle - reach, ivec2(0));
    ivec2 last = min(middle + reach, textureSize(u_image, 0) - 1);
    vec4 total = vec4(0.0);
    for (int row = first.y; row <= last.y; ++row)
        for (int column = first.x; column <= last.x; ++column) {
            ivec2 pixel = ivec2(column, row);
            vec4 value = texelFetch(u_image, pixel, 0);
            if (value.a > 0.5)
                total += covered_share(vec2(pixel - middle), radius_px) * vec4(value.rgb, 1.0);
        }
    out_value = own.a > 0.5 ? vec4(total.rgb / total.a, own.a) : own;
}
