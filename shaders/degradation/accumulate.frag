// Sum of sub-frames, weighted row by row: the previous sum plus one sub-frame, which also
// determines which pixels are valid.
#version 450 core

uniform sampler2D u_image;
uniform sampler2D u_sum;
uniform sampler2D u_row_weights;  // one column: the sub-frame's share of each row's exposure
layout(location = 0) out vec4 out_value;

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    vec4 value = texelFetch(u_image, pixel, 0);
    float weight = texelFetch(u_row_weights, ivec2(0, pixel.y), 0).r;
    out_value = vec4(texelFetch(u_sum, pixel, 0).rgb + weight * value.rgb, value.a);
}
