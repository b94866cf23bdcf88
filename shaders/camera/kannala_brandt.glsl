// bool ray_from_pixel(vec2 pixel_px, out vec3 ray): the polynomial fisheye of Kannala and Brandt.
// The ray is a unit direction in the optical frame; false past theta_max or the fold.
// Twin of omnisim/cameras/models/kannala_brandt.py.

#include "camera/parts/polar.glsl"

uniform vec2 u_focal_lengths_px;
uniform vec2 u_principal_point_px;
uniform float u_skew_px;
uniform vec4 u_coefficients;  // k1 ... k4
uniform float u_theta_edge_rad;
uniform float u_radius_max;  // in focal lengths

float radius_from_theta(float theta_rad) {
    float squared = theta_rad * theta_rad;
    vec4 k = u_coefficients;
    return theta_rad
        * (1.0 + squared * (k.x + squared * (k.y + squared * (k.z + squared * k.w))));
}

float slope_from_theta(float theta_rad) {
    float squared = theta_rad * theta_rad;
    vec4 k = vec4(3.0, 5.0, 7.0, 9.0) * u_coefficients;
    return 1.0 + squared * (k.x + squared * (k.y + squared * (k.z + squared * k.w)));
}

#include "camera/parts/theta_from_radius.glsl"

bool ray_from_pixel(vec2 pixel_px, out vec3 ray) {
    vec2 plane = (pixel_px - u_principal_point_px) / u_focal_lengths_px;
    plane.x -= u_skew_px / u_focal_lengths_px.x * plane.y;
    float radius = length(plane);
    float theta = theta_from_radius(min(radius, u_radius_max), 0.0, u_theta_edge_rad);
    ray = polar_ray(plane, radius, theta);
    return radius <= u_radius_max;
}
