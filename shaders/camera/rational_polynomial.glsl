// bool ray_from_pixel(vec2 pixel_px, out vec3 ray): OpenCV's pinhole lens with rational radial
// distortion, thin prism and tilted sensor. The ray is a unit direction in the optical frame; false
// where the image would fold or the pixel is behind the tilted sensor.
// Twin of omnisim/cameras/models/rational_polynomial.py. Source: OpenCV's module calib3d.

uniform vec2 u_focal_lengths_px;
uniform vec2 u_principal_point_px;
uniform vec3 u_numerator;  // k1, k2, k3
uniform vec3 u_denominator;  // k4, k5, k6
uniform vec2 u_tangential;  // p2, p1
uniform vec4 u_prism;  // s1, s3, s2, s4
uniform vec3 u_plane_from_sensor_x;  // rows of the homography
uniform vec3 u_plane_from_sensor_y;
uniform vec3 u_plane_from_sensor_w;
uniform float u_radius_max;  // on the plane before distortion

const int PLANE_STEPS = 8;

float polynomial(vec3 terms, float squared) {
    return 1.0 + squared * (terms.x + squared * (terms.y + squared * terms.z));
}

float growth(float squared) {
    return polynomial(u_numerator, squared) / max(polynomial(u_denominator, squared), 1e-9);
}

// derivative of the growth by the squared radius
float growth_slope(float squared) {
    vec3 powers = vec3(1.0, 2.0 * squared, 3.0 * squared * squared);
    float below = max(polynomial(u_denominator, squared), 1e-9);
    return (dot(u_numerator, powers) - growth(squared) * dot(u_denominator, powers)) / below;
}

// the radial part of the distortion, as a function of the radius before it
float radius_from_theta(float radius) {
    return radius * growth(radius * radius);
}

float slope_from_theta(float radius) {
    float squared = radius * radius;
    return growth(squared) + 2.0 * squared * growth_slope(squared);
}

#include "camera/parts/theta_from_radius.glsl"

vec2 distort(vec2 plane) {
    float squared = dot(plane, plane);
    vec2 offset = u_tangential + u_prism.xy + squared * u_prism.zw;
    return plane * (growth(squared) + 2.0 * dot(u_tangential, plane)) + squared * offset;
}

vec2 newton_step(vec2 plane, vec2 error) {
    float squared = dot(plane, plane);
    vec2 push = u_tangential + u_prism.xy + 2.0 * squared * u_prism.zw;
    vec2 outer = 2.0 * (growth_slope(squared) * plane + push);
    float diagonal = growth(squared) + 2.0 * dot(u_tangential, plane);
    vec2 row_x = outer.x * plane + 2.0 * plane.x * u_tangential + vec2(diagonal, 0.0);
    vec2 row_y = outer.y * plane + 2.0 * plane.y * u_tangential + vec2(0.0, diagonal);
    float determinant = max(row_x.x * row_y.y - row_x.y * row_y.x, 1e-6);
    return vec2(row_y.y * error.x - row_x.y * error.y, row_x.x * error.y - row_y.x * error.x)
        / determinant;
}

bool ray_from_pixel(vec2 pixel_px, out vec3 ray) {
    vec3 sensor = vec3((pixel_px - u_principal_point_px) / u_focal_lengths_px, 1.0);
    float w = dot(u_plane_from_sensor_w, sensor);
    vec2 distorted = vec2(dot(u_plane_from_sensor_x, sensor), dot(u_plane_from_sensor_y, sensor));
    distorted /= w > 1e-6 ? w : 1.0;
    float radius = length(distorted);
    vec2 plane = distorted;
    if (radius > 0.0) plane *= theta_from_radius(radius, 0.0, u_radius_max) / radius;
    for (int i = 0; i < PLANE_STEPS; ++i) {
        plane -= newton_step(plane, distort(plane) - distorted);
        plane *= u_radius_max / max(length(plane), u_radius_max);
    }
    vec2 miss = abs(distort(plane) - distorted);
    ray = normalize(vec3(plane, 1.0));
    // numerator and denominator cancel terms of several units: a float's rounding of both
    return w > 1e-6 && max(miss.x, miss.y) <= 1e-5 * max(1.0, radius);
}
