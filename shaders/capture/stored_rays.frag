// The exact capture, for models whose rays are searched for: they were found once, row by row, and
// do not change with the camera's pose.
#version 430 core

uniform int u_width_px;
layout(std430, binding = 7) readonly buffer Rays { vec4 rays[]; };  // xyz, and 1 where valid
#include "capture/emit.glsl"

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    vec4 ray = rays[pixel.y * u_width_px + pixel.x];
    emit(ray.w > 0.5, ray.xyz);
}
