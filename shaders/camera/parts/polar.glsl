// Rays by angle and azimuth, for radially symmetric lenses.
// vec2 azimuth_of(vec2 plane, float radius): azimuth as a unit vector; (1, 0) at the axis.
// vec3 polar_ray(vec2 plane, float radius, float theta_rad): unit ray in the optical frame.
// Twin of RadialCamera in omnisim/cameras/parametric_camera.py.

vec2 azimuth_of(vec2 plane, float radius) {
    return radius > 0.0 ? plane / radius : vec2(1.0, 0.0);
}

vec3 polar_ray(vec2 plane, float radius, float theta_rad) {
    return vec3(azimuth_of(plane, radius) * sin(theta_rad), cos(theta_rad));
}
