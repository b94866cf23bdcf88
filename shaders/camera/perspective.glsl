// bool ray_from_pixel(vec2 pixel_px, out vec3 ray): the pinhole camera. The ray is a unit
// direction in the optical frame; every pixel is valid.
// Twin of omnisim/cameras/models/perspective.py.

uniform float u_focal_length_px;
uniform vec2 u_principal_point_px;

bool ray_from_pixel(vec2 pixel_px, out vec3 ray) {
    ray = normalize(vec3((pixel_px - u_principal_point_px) / u_focal_length_px, 1.0));
    return true;
}
