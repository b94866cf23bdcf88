// bool ray_from_pixel(vec2 pixel_px, out vec3 ray): for a camera model that has no GLSL file.
// No pixel has a ray, so `capture/single_rays.*` draws all of them with NumPy's rays.

bool ray_from_pixel(vec2 pixel_px, out vec3 ray) {
    ray = vec3(0.0, 0.0, 1.0);
    return false;
}
