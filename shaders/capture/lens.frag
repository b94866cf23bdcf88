// Exact capture: the camera model gives each pixel's ray, without a mesh. CAMERA_MODEL is the
// model's file, and EMIT that of the output. MIRRORED negates the ray's z (`cameras/mirrored.py`).
// The target's first row is the top row of the image.
// u_first_px  pixel of the image in the target's corner
#version 450 core

uniform vec2 u_first_px;
#include CAMERA_MODEL
#include EMIT

void main() {
    vec3 ray;
    bool valid = ray_from_pixel(gl_FragCoord.xy - 0.5 + u_first_px, ray);
#ifdef MIRRORED
    ray.z = -ray.z;
#endif
    emit(valid, ray);
}
