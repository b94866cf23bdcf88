// Triangle ID that a texel shows: 1 + its ID, see triangle_ids.py; 0: nothing.
// With ALPHA_MASK only where alpha reaches the cutoff: a blended surface has one, too.
// With ALBEDO also the plain base colour: its square root, for which 8 bits are as fine as sRGB's.
// ALPHA_MASK and ALBEDO come with COLORED.
#version 430 core

#include "scene/material.glsl"

flat in uint v_first_plus_one;
layout(location = 0) out uint out_id_plus_one;

#ifdef ALBEDO
layout(location = 1) out vec4 out_albedo;
#endif

#ifdef TEXTURED
in vec2 v_texture_coordinate;
#endif
#ifdef COLORED
in vec4 v_color;
#endif

void main() {
#ifdef COLORED
    vec4 color = v_color;
#endif
#ifdef TEXTURED
    color *= texture_color(v_texture_coordinate);
#endif
#ifdef ALPHA_MASK
    if (color.a < ALPHA_CUTOFF) discard;
#endif
    out_id_plus_one = v_first_plus_one + uint(gl_PrimitiveID);
#ifdef ALBEDO
    out_albedo = vec4(sqrt(color.rgb), 1.0);
#endif
}
