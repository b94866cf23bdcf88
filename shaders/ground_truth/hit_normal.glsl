// void write_normal(Hit hit): with NORMALS, writes the normal of the visible side, interpolated as
// in scene/surface_normal.glsl, or the plane's normal without vertex normals. NORMAL_OUTPUTS:
// number of outputs.

#ifdef NORMALS
#define NORMAL_OUTPUTS 1
#include "scene/vertex_words.glsl"
layout(location = FIRST_DETAIL) out vec4 out_normal;  // viewpoint frame, unit

void write_no_normal() {
    out_normal = vec4(0.0);
}

void write_normal(Hit hit) {
    uint item = hit.primitive.x - 1u;
    uint first = draw_item_at(item).x + 3u * hit.primitive.y;
    // normalized below, so the weights need not be
    vec3 mesh = hit.weights.x * normal_at(vertex_at(first)) +
                hit.weights.y * normal_at(vertex_at(first + 1u)) +
                hit.weights.z * normal_at(vertex_at(first + 2u));
    vec4 normal_from_mesh[3] = matrix_at(item, SECOND_MATRIX);
    vec3 smooth_normal = vec3(
        dot(normal_from_mesh[0].xyz, mesh),
        dot(normal_from_mesh[1].xyz, mesh),
        dot(normal_from_mesh[2].xyz, mesh));
    vec3 normal = dot(smooth_normal, smooth_normal) > 0.0 ? smooth_normal : hit.normal;
    normal = normalize(normal * (dot(normal, hit.normal) < 0.0 ? -1.0 : 1.0));
    out_normal = vec4(normal, 1.0);
}
#else
#define NORMAL_OUTPUTS 0

void write_no_normal() {}

void write_normal(Hit hit) {}
#endif
