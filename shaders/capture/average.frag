// From a finer capture to the picture's pixels: the mean of those of its pixels that see something.
// The pixel is valid where at least half of them do.
#version 430 core

uniform sampler2D u_fine;
uniform int u_supersampling;  // fine pixels to a side of a pixel
layout(location = 0) out vec4 out_value;

void main() {
    ivec2 corner = ivec2(gl_FragCoord.xy) * u_supersampling;
    vec4 total = vec4(0.0);
    for (int row = 0; row < u_supersampling; ++row)
        for (int column = 0; column < u_supersampling; ++column)
            total += texelFetch(u_fine, corner + ivec2(column, row), 0);  // 0 where not valid
    bool valid = 2.0 * total.a >= float(u_supersampling * u_supersampling);
    out_value = valid ? vec4(total.rgb / total.a, 1.0) : vec4(0.0);
}
