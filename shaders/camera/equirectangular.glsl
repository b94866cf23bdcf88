// bool ray_from_pixel(vec2 pixel_px, out vec3 ray): the equirectangular panorama. The ray is a
// unit direction in the optical frame; false outside the image.
// Twin of omnisim/cameras/models/equirectangular.py.

uniform vec2 u_image_size_px;

const float PI = 3.14159265358979;

bool ray_from_pixel(vec2 pixel_px, out vec3 ray) {
    vec2 offset_px = pixel_px - 0.5 * (u_image_size_px - 1.0);
    vec2 angles = offset_px * vec2(2.0 * PI, PI) / u_image_size_px;
    ray = vec3(cos(angles.y) * sin(angles.x), sin(angles.y), cos(angles.y) * cos(angles.x));
    return all(lessThanEqual(abs(offset_px), 0.5 * u_image_size_px));
}
