// Dust and scratches: absorb a share of the light, and scatter a little light themselves.
#version 450 core

uniform sampler2D u_image;
uniform sampler2D u_dirt;  // absorbed share of the light, and added light
layout(location = 0) out vec4 out_value;

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    vec4 value = texelFetch(u_image, pixel, 0);
    vec2 dirt = value.a > 0.5 ? texelFetch(u_dirt, pixel, 0).rg : vec2(0.0);
    out_value = vec4(value.rgb * (1.0 - dirt.x) + dirt.y, value.a);
}
