// bool ray_from_pixel(vec2 pixel_px, out vec3 ray): the enhanced unified model. The ray is a unit
// direction in the optical frame; false past the fold, which exists for alpha > 0.5.
// Twin of omnisim/cameras/models/eucm.py. Source: Khomutenko et al. 2016, see there.

#include "camera/parts/unified_sphere.glsl"

uniform vec2 u_focal_lengths_px;
uniform vec2 u_principal_point_px;
uniform float u_alpha;
uniform float u_root_beta;   // square root of beta
uniform float u_radius_max;  // on the plane stretched by u_root_beta

bool ray_from_pixel(vec2 pixel_px, out vec3 ray) {
    vec2 plane = (pixel_px - u_principal_point_px) / u_focal_lengths_px * u_root_beta;
    float radius = length(plane);
    vec3 lifted = lift_alpha(plane * (u_radius_max / max(radius, u_radius_max)), u_alpha);
    ray = normalize(vec3(lifted.xy / u_root_beta, lifted.z));
    return radius <= u_radius_max;
}
