// Exposure and the sensor's response to R, G and B, as factors per frame.
#version 450 core

uniform sampler2D u_image;
uniform vec3 u_exposure_factors;
layout(location = 0) out vec4 out_value;

void main() {
    out_value = texelFetch(u_image, ivec2(gl_FragCoord.xy), 0) * vec4(u_exposure_factors, 1.0);
}
