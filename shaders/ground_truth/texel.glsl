// vec3 texel_of_ray(vec3 rig): atlas position, in texels, of a unit direction in the rig frame; and
// depth in the face per meter along the direction.
// bool is_drawn(vec3 rig): the atlas, which may be that of a part of the image, shows the texels
// around a direction.

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

bool is_drawn(vec3 rig) {
    int face = face_of(rig);
    vec3 local = u_face_from_rig[face] * rig;
    vec2 tangent = local.xy / max(local.z, MIN_DEPTH);
    int tile = tile_of(face, tangent);
    float texel = 0.99 / u_tile_px_per_tan[tile];  // rounding may not exclude a face's edge
    vec4 drawn = u_tile_padded_region[tile] + texel * vec4(1.0, 1.0, -1.0, -1.0);
    bool has_tiles = u_first_tile[face] < u_first_tile[face + 1];
    return has_tiles && all(greaterThanEqual(tangent, drawn.xy))
        && all(lessThanEqual(tangent, drawn.zw));
}
