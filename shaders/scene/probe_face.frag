// Face of a reflection probe's sharpest level: light, and alpha: 1 / distance in meters.
// The probe was drawn into an atlas of whole faces as large as those of the cube map, so that each
// texel is copied.
#version 450 core

#include "capture/tiles.glsl"
#include "scene/cube_face.glsl"

uniform sampler2D u_colors;
uniform sampler2D u_depths;  // reversed, with an infinite far plane
uniform float u_near_m;
uniform int u_face;
uniform float u_texel;  // 1 / size of the target
uniform vec2 u_atlas_px;
layout(location = 0) out vec4 out_color;

void main() {
    vec3 direction = direction_on_face(u_face, gl_FragCoord.xy * u_texel);
    int face = face_of(direction);
    vec3 local = u_face_from_rig[face] * direction;
    vec4 place = u_uv_from_tangent[u_first_tile[face]];
    ivec2 at = ivec2((place.xy + local.xy / local.z * place.zw) * u_atlas_px);
    float depth = texelFetch(u_depths, at, 0).r;
    out_color = vec4(texelFetch(u_colors, at, 0).rgb, depth / (u_near_m * length(direction)));
}
