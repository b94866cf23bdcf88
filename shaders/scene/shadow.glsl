// float directional_visibility(int i, vec3 position, vec3 normal): share of a light that reaches a
// surface at a position in metres from the effective viewpoint; 1 without SHADOWS.
// float punctual_visibility(int i, vec3 away, vec3 normal): likewise, `away` in metres from the light.
// normal: unit, of the surface's side that is seen.

float directional_visibility(int i, vec3 position, vec3 normal) {
    return 1.0;
}

float punctual_visibility(int i, vec3 away, vec3 normal) {
    return 1.0;
}
