// Exact capture: each pixel's ray by the camera model, no mesh. CAMERA_MODEL is the model's file;
// MIRRORED negates its depth (`cameras/mirrored.py`). EMIT is the output's file. The
// target's first row is the top row of the image.
#version 450 core

#include CAMERA_MODEL
#include EMIT

void main() {
    vec3 ray;
    bool valid = ray_from_pixel(gl_FragCoord.xy - 0.5, ray);
#ifdef MIRRORED
    ray.z = -ray.z;
#endif
    emit(valid, ray);
}
