// vec3 texel_of_ray(vec3 rig): atlas position, in texels, of a unit direction in the rig frame; and
// depth in the face per meter along the direction.

#include "capture/tiles.glsl"

uniform vec2 u_atlas_px;

vec3 texel_of_ray(vec3 rig) {
    int face = face_of(rig);
    vec3 local = u_face_from_rig[face] * rig;
    local.z = max(local.z, MIN_DEPTH);
    int tile = tile_of(face, local.xy / local.z);
    vec2 tangent =
        clamp(local.xy / local.z, u_tile_padded_region[tile].xy, u_tile_padded_region[tile].zw);
    vec4 texel_from_tangent = u_uv_from_tangent[tile] * u_atlas_px.xyxy;
    return vec3(texel_from_tangent.xy + tangent * texel_from_tangent.zw, local.z);
}
