// A capture whose rays are given, pixel by pixel: xyz, and 1 where there is one.
#version 430 core

uniform sampler2D u_rays;
#include "capture/emit.glsl"

void main() {
    vec4 ray = texelFetch(u_rays, ivec2(gl_FragCoord.xy), 0);
    emit(ray.w > 0.5, ray.xyz);
}
