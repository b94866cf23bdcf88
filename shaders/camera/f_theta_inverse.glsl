// bool ray_from_pixel(vec2 pixel_px, out vec3 ray): the f-theta lens, a polynomial from radius to
// angle. The ray is a unit direction in the optical frame; false past the domain's largest radius.
// Twin of omnisim/cameras/f_theta_inverse.py.

#include "camera/parts/polar.glsl"

const int COEFFICIENTS = 8;

uniform vec2 u_principal_point_px;
uniform mat2 u_axes_from_pixels;
uniform float u_coefficients[COEFFICIENTS];  // coefficients of the powers of r/r_max
uniform float u_radius_max_px;

bool ray_from_pixel(vec2 pixel_px, out vec3 ray) {
    vec2 offset_px = u_axes_from_pixels * (pixel_px - u_principal_point_px);
    float radius_px = length(offset_px);
    float share = min(radius_px / u_radius_max_px, 1.0);
    float theta = 0.0;
    for (int i = COEFFICIENTS - 1; i >= 0; --i) theta = (theta + u_coefficients[i]) * share;
    ray = polar_ray(offset_px, radius_px, theta);
    return radius_px <= u_radius_max_px;
}
