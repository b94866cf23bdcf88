// bool ray_from_pixel(vec2 pixel_px, out vec3 ray): the double sphere model. The ray is a unit
// direction in the optical frame; false past the fold, which exists for alpha > 0.5.
// Twin of omnisim/cameras/models/double_sphere.py. Source: Usenko et al. 2018, see there.

#include "camera/parts/unified_sphere.glsl"

uniform vec2 u_focal_lengths_px;
uniform vec2 u_principal_point_px;
uniform float u_xi;
uniform float u_alpha;
uniform float u_radius_max;  // in focal lengths

bool ray_from_pixel(vec2 pixel_px, out vec3 ray) {
    vec2 plane = (pixel_px - u_principal_point_px) / u_focal_lengths_px;
    float radius = length(plane);
    vec2 drawn_in = plane * (u_radius_max / max(radius, u_radius_max));
    vec3 second = normalize(lift_alpha(drawn_in, u_alpha));
    float root = sqrt(max(1.0 - u_xi * u_xi * dot(second.xy, second.xy), 0.0));
    ray = normalize(second * (second.z * u_xi + root) - vec3(0.0, 0.0, u_xi));
    return radius <= u_radius_max;
}
