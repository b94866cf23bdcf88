// bool ray_from_pixel(vec2 pixel_px, out vec3 ray): the orthographic fisheye, r = f sin(theta).
// The ray is a unit direction in the optical frame; false past theta_max.
// Twin of omnisim/cameras/models/orthographic.py.

#include "camera/parts/polar.glsl"

uniform float u_focal_length_px;
uniform vec2 u_principal_point_px;
uniform float u_radius_max;  // in focal lengths: sin(theta_max)

bool ray_from_pixel(vec2 pixel_px, out vec3 ray) {
    vec2 offset_px = pixel_px - u_principal_point_px;
    float radius = length(offset_px) / u_focal_length_px;
    float sine = min(radius, u_radius_max);
    // 1 - sine^2 in pixels, whose squares are nearly exact: it vanishes at 90 degrees
    float f_px = u_focal_length_px;
    float cosine = radius <= u_radius_max
        ? sqrt(max(f_px * f_px - dot(offset_px, offset_px), 0.0)) / f_px
        : sqrt(max(1.0 - sine * sine, 0.0));
    ray = vec3(azimuth_of(offset_px, length(offset_px)) * sine, cosine);
    return radius <= u_radius_max;
}
