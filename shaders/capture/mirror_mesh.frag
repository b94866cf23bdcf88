// Capture by the mirror's mesh: the point of the flat polygon that a pixel sees, projected from the
// effective viewpoint onto the cube (the paper's section 2.3). EMIT is the output's file.
#version 450 core

in vec3 v_ray;
#include EMIT

void main() {
    emit(true, v_ray);
}
