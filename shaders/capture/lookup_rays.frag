// Exact capture from precomputed rays, for camera models that compute rays by iteration.
#version 450 core

uniform sampler2D u_rays;  // direction, and 1 if valid
#include EMIT

void main() {
    vec4 ray = texelFetch(u_rays, ivec2(gl_FragCoord.xy), 0);
    emit(ray.w > 0.5, ray.xyz);
}
