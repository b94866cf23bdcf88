// Exact capture from precomputed rays, for camera models that compute rays by iteration.
#version 450 core

uniform sampler2D u_rays;  // direction, and 1 if valid
uniform vec2 u_first_px;   // pixel of the image in the target's corner
#include EMIT

void main() {
    vec4 ray = texelFetch(u_rays, ivec2(gl_FragCoord.xy + u_first_px), 0);
    emit(ray.w > 0.5, ray.xyz);
}
