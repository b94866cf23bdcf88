// Demosaicing: Malvar's 5 x 5 filters if all their pixels are valid, else the mean of the valid
// pixels among the nearest ones of the color.
// Source: Malvar, He and Cutler, ICASSP 2004.
#version 450 core

uniform sampler2D u_image;
uniform bool u_malvar;
#include "degradation/bayer_pattern.glsl"
layout(location = 0) out vec4 out_value;

vec2 raw_at(ivec2 pixel) {
    if (any(lessThan(pixel, ivec2(0))) || any(greaterThanEqual(pixel, textureSize(u_image, 0))))
        return vec2(0.0);
    vec2 value = texelFetch(u_image, pixel, 0).ra;
    return value.y > 0.5 ? value : vec2(0.0);
}

// Mean of the valid pixels of a color at the sides, or else at the corners.
float nearest_mean(ivec2 pixel, int color, float own) {
    for (int corners = 0; corners <= 1; ++corners) {
        vec2 total = vec2(0.0);
        for (int side = 0; side < 4; ++side) {
            ivec2 offset = corners == 1 ? ivec2(2 * (side & 1) - 1, (side & 2) - 1)
                : ivec2[4](ivec2(0, -1), ivec2(-1, 0), ivec2(1, 0), ivec2(0, 1))[side];
            if (color_of(pixel + offset) == color)
                total += raw_at(pixel + offset);
        }
        if (total.y > 0.0)
            return total.x / total.y;
    }
    return own;
}

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    vec4 value = texelFetch(u_image, pixel, 0);
    int own_color = color_of(pixel);
    vec2 own = value.ra;

    // sums of the pixels with equal Malvar weights; y counts the valid ones
    vec2 sides = raw_at(pixel + ivec2(-1, 0)) + raw_at(pixel + ivec2(1, 0));
    vec2 above = raw_at(pixel + ivec2(0, -1)) + raw_at(pixel + ivec2(0, 1));
    vec2 corners = raw_at(pixel + ivec2(-1, -1)) + raw_at(pixel + ivec2(1, -1))
        + raw_at(pixel + ivec2(-1, 1)) + raw_at(pixel + ivec2(1, 1));
    vec2 far_sides = raw_at(pixel + ivec2(-2, 0)) + raw_at(pixel + ivec2(2, 0));
    vec2 far_above = raw_at(pixel + ivec2(0, -2)) + raw_at(pixel + ivec2(0, 2));
    bool whole = sides.y + above.y + corners.y + far_sides.y + far_above.y > 11.5;

    vec3 guess;
    if (u_malvar && whole && own.y > 0.5) {
        float cross = 4.0 * own.x + 2.0 * (sides.x + above.x) - far_sides.x - far_above.x;
        float row = 5.0 * own.x + 4.0 * sides.x - corners.x - far_sides.x + 0.5 * far_above.x;
        float column = 5.0 * own.x + 4.0 * above.x - corners.x - far_above.x + 0.5 * far_sides.x;
        float other = 6.0 * own.x + 2.0 * corners.x - 1.5 * (far_sides.x + far_above.x);
        bool red_row = ((pixel.y + u_red_xy.y) & 1) == 0;
        guess = own_color == 1
            ? vec3(red_row ? row : column, 0.0, red_row ? column : row)
            : vec3(other, cross, other);
        guess /= 8.0;
    } else {
        for (int color = 0; color < 3; ++color)
            guess[color] = nearest_mean(pixel, color, own.x);
    }
    guess[own_color] = own.x;
    out_value = own.y > 0.5 ? vec4(guess, value.a) : value;
}
