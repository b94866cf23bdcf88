// vec3 place_of(vec3 rig): where in the atlas a unit direction in the rig frame looks, in texels; and
// how deep in its face one metre along it leads.

#include "capture/cube_faces.glsl"

uniform vec2 u_atlas_px;

vec3 place_of(vec3 rig) {
    int face = face_of(rig);
    vec3 local = u_face_from_rig[face] * rig;
    int number = tile_of(face, local.xy / local.z);
    vec2 tangent = clamp(local.xy / local.z, u_tile_window[number].xy, u_tile_window[number].zw);
    vec4 tile = u_tile_place[number] * u_atlas_px.xyxy;
    return vec3(tile.xy + tangent * tile.zw, local.z);
}
