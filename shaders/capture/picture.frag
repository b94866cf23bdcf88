// The picture's pixels: the mean of their captured pixels that see something, linear, and encoded in
// sRGB. A pixel is valid where at least half of its captured pixels are.
// With STORED_LOOKUPS each of them is a place in the atlas, found once, as it does not depend on
// the camera's pose. Otherwise they were drawn, into a finer picture.
// SUPERSAMPLING: captured pixels to a side of a pixel; known when this is compiled, so that the
// loops unroll.
#version 430 core

const int CAPTURED = SUPERSAMPLING * SUPERSAMPLING;
#ifdef STORED_LOOKUPS
// Those of a pixel one after the other, row by row: atlas coordinates, below 0 where not valid.
layout(std430, binding = 5) readonly buffer Places { vec2 places[]; };
#ifdef LEVELS
layout(std430, binding = 6) readonly buffer Levels { float levels[]; };
#endif
uniform sampler2D u_atlas;
uniform int u_width_px;
#else
uniform sampler2D u_fine;
#endif
layout(location = 0) out vec4 out_encoded;
layout(location = 1) out vec4 out_linear;
#include "common/srgb.glsl"

vec4 captured(ivec2 pixel, ivec2 part) {
#ifdef STORED_LOOKUPS
    int at = (pixel.y * u_width_px + pixel.x) * CAPTURED + part.y * SUPERSAMPLING + part.x;
#ifdef LEVELS
    vec3 color = textureLod(u_atlas, places[at], levels[at]).rgb;
#else
    vec3 color = texture(u_atlas, places[at]).rgb;  // has no levels, and is quicker so
#endif
    return places[at].x < 0.0 ? vec4(0.0) : vec4(color, 1.0);
#else
    return texelFetch(u_fine, pixel * SUPERSAMPLING + part, 0);  // 0 where not valid
#endif
}

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    vec4 total = vec4(0.0);
    for (int row = 0; row < SUPERSAMPLING; ++row)
        for (int column = 0; column < SUPERSAMPLING; ++column)
            total += captured(pixel, ivec2(column, row));
    bool valid = 2.0 * total.a >= float(CAPTURED);
    out_linear = valid ? vec4(total.rgb / total.a, 1.0) : vec4(0.0);
    out_encoded = vec4(srgb_from_linear(clamp(out_linear.rgb, 0.0, 1.0)), out_linear.a);
}
