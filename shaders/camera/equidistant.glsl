// bool ray_from_pixel(vec2 pixel_px, out vec3 ray): the equidistant fisheye, r = f theta. The ray
// is a unit direction in the optical frame; false past theta_max.
// Twin of omnisim/cameras/models/equidistant.py.

#include "camera/parts/polar.glsl"

uniform float u_focal_length_px;
uniform vec2 u_principal_point_px;
uniform float u_radius_max;  // in focal lengths: theta_max

bool ray_from_pixel(vec2 pixel_px, out vec3 ray) {
    vec2 plane = (pixel_px - u_principal_point_px) / u_focal_length_px;
    float radius = length(plane);
    ray = polar_ray(plane, radius, min(radius, u_radius_max));
    return radius <= u_radius_max;
}
