// The exact capture: each pixel's ray by the camera model, no mesh. CAMERA_MODEL is the model's
// file; MIRRORED turns its depth round (`cameras/mirrored.py`). The target's first row is the top row
// of the picture.
#version 430 core

#include CAMERA_MODEL
#include "capture/emit.glsl"

void main() {
    vec3 ray;
    bool valid = ray_from_pixel(gl_FragCoord.xy - 0.5, ray);
#ifdef MIRRORED
    ray.z = -ray.z;
#endif
    emit(valid, ray);
}
