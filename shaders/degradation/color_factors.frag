// Mirror reflectance and tint, or white balance: each color times its factor.
#version 450 core

uniform sampler2D u_image;
uniform vec3 u_factors;
layout(location = 0) out vec4 out_value;

void main() {
    out_value = texelFetch(u_image, ivec2(gl_FragCoord.xy), 0) * vec4(u_factors, 1.0);
}
