// Single pixels with rays of their own. EMIT is the output's file.
#version 450 core

flat in vec4 v_ray;  // direction, and 1 if valid
#include EMIT

void main() {
    emit(v_ray.w > 0.5, v_ray.xyz);
}
