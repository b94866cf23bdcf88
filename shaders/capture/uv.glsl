// vec3 uv_level_from_ray(vec3 ray): texture coordinates in the atlas and mip level of a ray of any
// length, optical frame. The level follows from the ray's derivatives.
// Each tile of the atlas is drawn slightly wider than its region, so that filtering does not reach
// into the next tile.

#include "capture/tiles.glsl"

uniform float u_max_level;   // coarsest mip level of the atlas
uniform float u_level_bias;  // offset from the level whose texels are as wide as a pixel

vec3 uv_level_from_ray(vec3 ray) {
    // The ray's derivatives are smooth across the cube's edges; those of coordinates are not.
    vec3 rig = u_rig_from_optical * ray;
    vec3 rig_dx = dFdx(rig), rig_dy = dFdy(rig);
    int face = face_of(rig);
    vec3 local = u_face_from_rig[face] * rig;
    local.z = max(local.z, MIN_DEPTH);
    vec2 tangent = local.xy / local.z;
    int tile = tile_of(face, tangent);

    vec3 dx = u_face_from_rig[face] * rig_dx, dy = u_face_from_rig[face] * rig_dy;
    vec2 tangent_dx = (dx.xy - tangent * dx.z) / local.z;
    vec2 tangent_dy = (dy.xy - tangent * dy.z) / local.z;
    float squared = max(dot(tangent_dx, tangent_dx), dot(tangent_dy, tangent_dy));
    float texels = u_tile_px_per_tan[tile] * sqrt(max(squared, 1e-20));
    float level = clamp(log2(texels) + u_level_bias, 0.0, u_max_level);

    tangent = clamp(tangent, u_tile_padded_region[tile].xy, u_tile_padded_region[tile].zw);
    return vec3(u_uv_from_tangent[tile].xy + tangent * u_uv_from_tangent[tile].zw, level);
}
