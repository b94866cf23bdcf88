// bool ray_from_pixel(vec2 pixel_px, out vec3 ray): the equisolid fisheye, r = 2 f sin(theta/2).
// The ray is a unit direction in the optical frame; false past theta_max.
// Twin of omnisim/cameras/models/equisolid.py.

#include "camera/parts/polar.glsl"

uniform float u_focal_length_px;
uniform vec2 u_principal_point_px;
uniform float u_radius_max;  // in focal lengths: 2 sin(theta_max/2)

bool ray_from_pixel(vec2 pixel_px, out vec3 ray) {
    vec2 offset_px = pixel_px - u_principal_point_px;
    float radius = length(offset_px) / u_focal_length_px;
    float half_sine = 0.5 * min(radius, u_radius_max);
    // 1 - half_sine^2 in pixels, whose squares are nearly exact: it vanishes at 180 degrees
    float full_px = 2.0 * u_focal_length_px;
    float half_cosine = sqrt(max(full_px * full_px - dot(offset_px, offset_px), 0.0)) / full_px;
    half_cosine = radius <= u_radius_max ? half_cosine
        : sqrt(max(1.0 - half_sine * half_sine, 0.0));
    vec2 across = azimuth_of(offset_px / u_focal_length_px, radius) * 2.0 * half_sine * half_cosine;
    ray = vec3(across, 1.0 - 2.0 * half_sine * half_sine);
    return radius <= u_radius_max;
}
