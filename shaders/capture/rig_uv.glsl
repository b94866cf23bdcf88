// vec2 uv_of(vec3 rig): texture coordinates in the atlas of a direction in the rig frame.
// float level_of(vec3 rig, vec3 rig_dx, vec3 rig_dy): mip level, by its derivatives.
// As capture/uv.glsl has both of a ray at once.

#include "capture/tiles.glsl"

uniform float u_max_level;   // of the atlas's mip levels
uniform float u_level_bias;  // added to the level at which a texel is as wide as the pixel

vec2 uv_of(vec3 rig) {
    int face = face_of(rig);
    vec3 local = u_face_from_rig[face] * rig;
    vec2 tangent = local.xy / local.z;
    int tile = tile_of(face, tangent);
    tangent = clamp(tangent, u_tile_padded_region[tile].xy, u_tile_padded_region[tile].zw);
    return u_uv_from_tangent[tile].xy + tangent * u_uv_from_tangent[tile].zw;
}

float level_of(vec3 rig, vec3 rig_dx, vec3 rig_dy) {
    int face = face_of(rig);
    vec3 local = u_face_from_rig[face] * rig;
    vec2 tangent = local.xy / local.z;
    vec3 dx = u_face_from_rig[face] * rig_dx, dy = u_face_from_rig[face] * rig_dy;
    vec2 tangent_dx = (dx.xy - tangent * dx.z) / local.z;
    vec2 tangent_dy = (dy.xy - tangent * dy.z) / local.z;
    float squared = max(dot(tangent_dx, tangent_dx), dot(tangent_dy, tangent_dy));
    float texels = u_tile_px_per_tan[tile_of(face, tangent)] * sqrt(max(squared, 1e-20));
    return clamp(log2(texels) + u_level_bias, 0.0, u_max_level);
}
