// Face of a reflection probe's rougher level: the sharper level, filtered by GGX facets.
// The view is along the normal, and each direction has the share of its cosine.
// Source: Karis, "Real shading in Unreal Engine 4", 2013.
#version 450 core

#include "scene/cube_face.glsl"

uniform samplerCubeArray u_cubes;  // sharper level only
uniform float u_alpha;    // squared roughness between the two levels
uniform int u_facets;  // number of samples
uniform int u_face;
uniform float u_cube;
uniform float u_texel;  // 1 / size of the target
layout(location = 0) out vec4 out_color;

const float TURN = 6.28318530717959;
const float R2_STEP = 0.7548776662466927;

void main() {
    vec3 normal = normalize(direction_on_face(u_face, gl_FragCoord.xy * u_texel));
    vec3 helper = abs(normal.z) < 0.7 ? vec3(0.0, 0.0, 1.0) : vec3(1.0, 0.0, 0.0);
    vec3 side = normalize(cross(helper, normal)), up = cross(normal, side);
    vec4 total = vec4(0.0);
    float weight = 0.0;
    for (int number = 0; number < u_facets; ++number) {
        float share = (float(number) + 0.5) / float(u_facets);
        float azimuth = TURN * fract(float(number) * R2_STEP);
        float squared = (1.0 - share) / (1.0 + (u_alpha * u_alpha - 1.0) * share);
        float height = sqrt(squared), width = sqrt(1.0 - squared);
        float along = 2.0 * squared - 1.0;  // cosine of the reflected direction
        if (along <= 0.0) continue;
        vec3 beside = cos(azimuth) * side + sin(azimuth) * up;
        vec3 direction = along * normal + 2.0 * height * width * beside;
        total += along * textureLod(u_cubes, vec4(direction, u_cube), 0.0);
        weight += along;
    }
    out_color = total / weight;
}
