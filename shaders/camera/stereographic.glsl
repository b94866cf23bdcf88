// bool ray_from_pixel(vec2 pixel_px, out vec3 ray): the stereographic fisheye,
// r = 2 f tan(theta/2). The ray is a unit direction in the optical frame; false past theta_max.
// Twin of omnisim/cameras/models/stereographic.py.

#include "camera/parts/polar.glsl"

uniform float u_focal_length_px;
uniform vec2 u_principal_point_px;
uniform float u_radius_max;  // in focal lengths: 2 tan(theta_max/2)

bool ray_from_pixel(vec2 pixel_px, out vec3 ray) {
    vec2 plane = (pixel_px - u_principal_point_px) / u_focal_length_px;
    float radius = length(plane);
    float half_tangent = 0.5 * min(radius, u_radius_max);
    float squared = half_tangent * half_tangent;
    // no arc tangent: OpenGL allows it large errors
    ray = vec3(azimuth_of(plane, radius) * 2.0 * half_tangent, 1.0 - squared) / (1.0 + squared);
    return radius <= u_radius_max;
}
