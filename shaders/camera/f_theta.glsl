// bool ray_from_pixel(vec2 pixel_px, out vec3 ray): the f-theta lens, a polynomial from angle to
// radius. The ray is a unit direction in the optical frame; false past theta_max or the fold.
// Twin of omnisim/cameras/models/f_theta.py.

#include "camera/parts/polar.glsl"

const int COEFFICIENTS = 8;

uniform vec2 u_principal_point_px;
uniform mat2 u_axes_from_pixels;
uniform float u_coefficients_px[COEFFICIENTS];  // k1 ... k8
uniform float u_theta_edge_rad;
uniform float u_radius_max_px;

float radius_from_theta(float theta_rad) {
    float sum = 0.0;
    for (int i = COEFFICIENTS - 1; i >= 0; --i) sum = (sum + u_coefficients_px[i]) * theta_rad;
    return sum;
}

float slope_from_theta(float theta_rad) {
    float sum = 0.0;
    for (int i = COEFFICIENTS - 1; i >= 0; --i)
        sum = sum * theta_rad + float(i + 1) * u_coefficients_px[i];
    return sum;
}

#include "camera/parts/theta_from_radius.glsl"

bool ray_from_pixel(vec2 pixel_px, out vec3 ray) {
    vec2 offset_px = u_axes_from_pixels * (pixel_px - u_principal_point_px);
    float radius_px = length(offset_px);
    float theta = theta_from_radius(min(radius_px, u_radius_max_px), 0.0, u_theta_edge_rad);
    ray = polar_ray(offset_px, radius_px, theta);
    return radius_px <= u_radius_max_px;
}
