// bool ray_from_pixel(vec2 pixel_px, out vec3 ray): fisheye polynomial with tangential distortion
// and a thin prism. The ray is a unit direction in the optical frame; false past theta_max or where
// the image would fold.
// Twin of omnisim/cameras/models/thin_prism_fisheye.py.

#include "camera/parts/polar.glsl"

uniform vec2 u_focal_lengths_px;
uniform vec2 u_principal_point_px;
uniform vec3 u_inner_terms;  // k0, k1, k2
uniform vec3 u_outer_terms;  // k3, k4, k5
uniform vec2 u_tangential;  // p0, p1
uniform vec4 u_prism;  // s0, s2, s1, s3
uniform float u_theta_edge_rad;
uniform float u_radius_max;  // before the bend, in focal lengths

const int BEND_STEPS = 8;

float series(vec3 inner, vec3 outer, float squared) {
    vec3 k = outer;
    float rest = squared * (k.x + squared * (k.y + squared * k.z));
    return 1.0 + squared * (inner.x + squared * (inner.y + squared * (inner.z + rest)));
}

float radius_from_theta(float theta_rad) {
    return theta_rad * series(u_inner_terms, u_outer_terms, theta_rad * theta_rad);
}

float slope_from_theta(float theta_rad) {
    vec3 inner = vec3(3.0, 5.0, 7.0) * u_inner_terms, outer = vec3(9.0, 11.0, 13.0) * u_outer_terms;
    return series(inner, outer, theta_rad * theta_rad);
}

#include "camera/parts/theta_from_radius.glsl"

vec2 bend(vec2 plane) {
    float squared = dot(plane, plane);
    vec2 offset = u_tangential + u_prism.xy + squared * u_prism.zw;
    return plane * (1.0 + 2.0 * dot(u_tangential, plane)) + squared * offset;
}

vec2 bend_step(vec2 plane, vec2 error) {
    vec2 outer = 2.0 * (u_tangential + u_prism.xy + 2.0 * dot(plane, plane) * u_prism.zw);
    float diagonal = 1.0 + 2.0 * dot(u_tangential, plane);
    vec2 row_x = outer.x * plane + 2.0 * plane.x * u_tangential + vec2(diagonal, 0.0);
    vec2 row_y = outer.y * plane + 2.0 * plane.y * u_tangential + vec2(0.0, diagonal);
    float determinant = max(row_x.x * row_y.y - row_x.y * row_y.x, 1e-6);
    return vec2(row_y.y * error.x - row_x.y * error.y, row_x.x * error.y - row_y.x * error.x)
        / determinant;
}

bool ray_from_pixel(vec2 pixel_px, out vec3 ray) {
    vec2 bent = (pixel_px - u_principal_point_px) / u_focal_lengths_px;
    vec2 plane = bent * (u_radius_max / max(length(bent), u_radius_max));
    for (int i = 0; i < BEND_STEPS; ++i) {
        plane -= bend_step(plane, bend(plane) - bent);
        plane *= u_radius_max / max(length(plane), u_radius_max);
    }
    vec2 miss = abs(bend(plane) - bent);
    float radius = length(plane);
    ray = polar_ray(plane, radius, theta_from_radius(radius, 0.0, u_theta_edge_rad));
    return max(miss.x, miss.y) <= 2e-6 * max(1.0, length(bent));
}
