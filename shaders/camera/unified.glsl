// bool ray_from_pixel(vec2 pixel_px, out vec3 ray): the unified model of Geyer and Mei with
// distortion. The ray is a unit direction in the optical frame; false where the image would fold.
// Twin of omnisim/cameras/models/unified.py and lens_polynomials.py. Source: Mei & Rives 2007, see
// there.

uniform vec2 u_focal_lengths_px;
uniform vec2 u_principal_point_px;
uniform float u_xi;
uniform vec4 u_distortion;  // k1, k2, p1, p2
uniform float u_k3;
uniform float u_skew_px;
uniform float u_radius_max;  // on the plane before distortion

const int PLANE_STEPS = 8;

float growth(float squared) {
    return 1.0 + squared * (u_distortion.x + squared * (u_distortion.y + squared * u_k3));
}

// the radial part of the distortion, as a function of the radius before it
float radius_from_theta(float radius) {
    float squared = radius * radius;
    return radius * growth(squared);
}

float slope_from_theta(float radius) {
    float squared = radius * radius;
    float above = 5.0 * u_distortion.y + squared * 7.0 * u_k3;
    return 1.0 + squared * (3.0 * u_distortion.x + squared * above);
}

#include "camera/parts/theta_from_radius.glsl"

vec2 distort(vec2 plane) {
    float squared = dot(plane, plane);
    vec2 tangential = u_distortion.wz;
    return plane * (growth(squared) + 2.0 * dot(tangential, plane)) + squared * tangential;
}

vec2 newton_step(vec2 plane, vec2 error) {
    float squared = dot(plane, plane);
    vec2 tangential = u_distortion.wz;
    float bend = 2.0 * u_distortion.x + squared * (4.0 * u_distortion.y + 6.0 * u_k3 * squared);
    vec2 diagonal = growth(squared) + bend * plane * plane + 2.0 * dot(tangential, plane)
        + 4.0 * tangential * plane;
    float mixed = bend * plane.x * plane.y + 2.0 * dot(tangential, plane.yx);
    float determinant = max(diagonal.x * diagonal.y - mixed * mixed, 1e-6);
    return (diagonal.yx * error - mixed * error.yx) / determinant;
}

bool ray_from_pixel(vec2 pixel_px, out vec3 ray) {
    vec2 distorted = (pixel_px - u_principal_point_px) / u_focal_lengths_px;
    distorted.x -= u_skew_px / u_focal_lengths_px.x * distorted.y;
    float radius = length(distorted);
    vec2 plane = distorted;
    if (radius > 0.0) plane *= theta_from_radius(radius, 0.0, u_radius_max) / radius;
    for (int i = 0; i < PLANE_STEPS; ++i) {
        plane -= newton_step(plane, distort(plane) - distorted);
        plane *= u_radius_max / max(length(plane), u_radius_max);
    }
    vec2 miss = abs(distort(plane) - distorted);

    float squared = dot(plane, plane);
    float root = sqrt(max(1.0 + (1.0 - u_xi * u_xi) * squared, 0.0));
    float height = (u_xi + root) / (1.0 + squared);
    ray = normalize(vec3(plane * height, height - u_xi));
    return max(miss.x, miss.y) <= 1e-6 * max(1.0, radius);  // a float's rounding
}
