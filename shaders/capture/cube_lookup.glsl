// vec3 color_from_ray(vec3 ray): what the virtual cameras saw in a direction, linear RGB.
// The ray is in the optical frame, of any length. The faces stand beside each other in one atlas;
// each was drawn a little wider than it is looked up, so that no lookup crosses into its neighbour.

#include "capture/cube_faces.glsl"

uniform sampler2D u_atlas;
uniform float u_face_texels[FACES];  // texels in a tangent of 1
uniform float u_max_level;           // of the atlas's mip levels

vec3 color_from_ray(vec3 ray) {
    // Derivatives of the ray are smooth across the cube's edges, those of coordinates are not.
    vec3 rig = u_rig_from_optical * ray;
    vec3 rig_dx = dFdx(rig), rig_dy = dFdy(rig);
    int face = face_of(rig);
    vec3 local = u_face_from_rig[face] * rig;
    vec2 tangent = local.xy / local.z;

    vec3 dx = u_face_from_rig[face] * rig_dx, dy = u_face_from_rig[face] * rig_dy;
    vec2 tangent_dx = (dx.xy - tangent * dx.z) / local.z;
    vec2 tangent_dy = (dy.xy - tangent * dy.z) / local.z;
    float squared = max(dot(tangent_dx, tangent_dx), dot(tangent_dy, tangent_dy));
    float texels = u_face_texels[face] * sqrt(max(squared, 1e-20));
    float level = clamp(log2(texels), 0.0, u_max_level);

    tangent = clamp(tangent, u_face_window[face].xy, u_face_window[face].zw);
    return textureLod(u_atlas, u_face_tile[face].xy + tangent * u_face_tile[face].zw, level).rgb;
}
