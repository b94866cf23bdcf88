// vec3 lift_alpha(vec2 plane, float alpha): ray, not of unit length, of a point of the normalized
// plane by the alpha form of the unified model; radius up to 1/sqrt(2 alpha - 1) if alpha > 0.5.
// Twin of `lift_alpha` in omnisim/cameras/parametric_camera.py.

vec3 lift_alpha(vec2 plane, float alpha) {
    float squared = dot(plane, plane);
    float root = sqrt(max(1.0 - (2.0 * alpha - 1.0) * squared, 0.0));
    return vec3(plane, (1.0 - alpha * alpha * squared) / (alpha * root + 1.0 - alpha));
}
