// bool ray_from_pixel(vec2 pixel_px, out vec3 ray): Gazebo's custom lens. The ray is a unit
// direction in the optical frame; false where its function folds, or past theta_max.
// Twin of omnisim/cameras/models/gazebo.py.

#include "camera/parts/polar.glsl"

uniform float u_focal_length_px;
uniform vec2 u_principal_point_px;
uniform vec3 u_constants;  // c1, c2, c3
uniform int u_function;    // 0: sin, 1: tan, 2: the argument itself
uniform vec2 u_theta_limits_rad;
uniform vec2 u_radius_limits;  // in focal lengths

float radius_from_theta(float theta_rad) {
    float argument = theta_rad / u_constants.y + u_constants.z;
    float value = u_function == 0 ? sin(argument) : u_function == 1 ? tan(argument) : argument;
    return u_constants.x * value;
}

float slope_from_theta(float theta_rad) {
    float argument = theta_rad / u_constants.y + u_constants.z;
    float cosine = cos(argument);
    float slope = u_function == 0 ? cosine : u_function == 1 ? 1.0 / (cosine * cosine) : 1.0;
    return u_constants.x / u_constants.y * slope;
}

#include "camera/parts/theta_from_radius.glsl"

bool ray_from_pixel(vec2 pixel_px, out vec3 ray) {
    vec2 plane = (pixel_px - u_principal_point_px) / u_focal_length_px;
    float radius = length(plane);
    float inside = clamp(radius, u_radius_limits.x, u_radius_limits.y);
    // no arc functions: OpenGL allows them large errors
    float theta = theta_from_radius(inside, u_theta_limits_rad.x, u_theta_limits_rad.y);
    ray = polar_ray(plane, radius, theta);
    return radius == inside;
}
