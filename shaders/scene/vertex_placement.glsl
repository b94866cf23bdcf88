// Position and normal of a vertex in the viewpoint frame.
// void pass_placement(): passes v_position in meters, with POSITION; v_normal of any length, with
//     LIT; and its places on the shadow maps, with VERTEX_PLACES.
// u_viewpoint_from_mesh  transform of a single item's mesh
// u_normal_from_mesh     cofactor matrix of it, for normals under any scale

#if defined(CLUSTERED) && (defined(LIT) || defined(POSITION))
layout(location = 10) in mat3x4 in_viewpoint_from_object;  // rows of a rigid transform
#endif

#ifdef POSITION
out vec3 v_position;
#ifdef CLUSTERED
void pass_position() {
    v_position = vec4(in_position, 1.0) * in_viewpoint_from_object;
}
#else
uniform mat4 u_viewpoint_from_mesh;

void pass_position() {
    v_position = (u_viewpoint_from_mesh * vec4(in_position, 1.0)).xyz;
}
#endif
#else
void pass_position() {}
#endif

#ifdef LIT
layout(location = 3) in vec3 in_normal;
out vec3 v_normal;
#ifdef CLUSTERED
void pass_normal() {
    v_normal = vec4(in_normal, 0.0) * in_viewpoint_from_object;
}
#else
uniform mat3 u_normal_from_mesh;

void pass_normal() {
    v_normal = u_normal_from_mesh * in_normal;
}
#endif
#else
void pass_normal() {}
#endif

#ifdef VERTEX_PLACES
#include "scene/light_positions.glsl"
#include "scene/shadow_places.glsl"
out vec3 v_places[PLACES];

void pass_shadow_places() {
    for (int place = 0; place < PLACES; ++place) v_places[place] = place_on_map(place, v_position);
}
#else
void pass_shadow_places() {}
#endif

void pass_placement() {
    pass_position();
    pass_normal();
    pass_shadow_places();
}
