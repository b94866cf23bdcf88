// Vignetting: an even polynomial of the image radius, at least 0.
#version 450 core

uniform sampler2D u_image;
uniform vec3 u_coefficients;  // coefficients of r², r⁴, r⁶
uniform vec3 u_higher;        // coefficients of r⁸, r¹⁰, r¹²
#include "degradation/squared_radius.glsl"
layout(location = 0) out vec4 out_value;

void main() {
    float squared = squared_radius(gl_FragCoord.xy - 0.5);
    float higher = squared * (u_higher.x + squared * (u_higher.y + squared * u_higher.z));
    float factor = 1.0 + squared * (u_coefficients.x
        + squared * (u_coefficients.y + squared * (u_coefficients.z + higher)));
    vec4 value = texelFetch(u_image, ivec2(gl_FragCoord.xy), 0);
    out_value = value * vec4(vec3(max(factor, 0.0)), 1.0);
}
