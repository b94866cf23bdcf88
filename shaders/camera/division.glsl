// bool ray_from_pixel(vec2 pixel_px, out vec3 ray): the division model of a wide lens.
// The ray is a unit direction in the optical frame; false past theta_max or the fold.
// Twin of omnisim/cameras/models/division.py.

uniform vec2 u_focal_lengths_px;
uniform vec2 u_principal_point_px;
uniform float u_k;
uniform float u_radius_max;  // in focal lengths

bool ray_from_pixel(vec2 pixel_px, out vec3 ray) {
    vec2 plane = (pixel_px - u_principal_point_px) / u_focal_lengths_px;
    float radius = length(plane);
    plane *= u_radius_max / max(radius, u_radius_max);
    ray = normalize(vec3(plane, 1.0 + u_k * dot(plane, plane)));
    return radius <= u_radius_max;
}
