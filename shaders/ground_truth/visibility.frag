// Triangle ID that a texel shows: 1 + its ID in this frame, see triangle_ids.py; 0: nothing.
// With HOLES only where alpha reaches the cutoff: a blended surface has one, too.
// With ALBEDO also the plain base colour: its square root, for which 8 bits are as fine as sRGB's.
#version 430 core

uniform uint u_first_plus_one;  // 1 + ID of the call's first triangle
layout(location = 0) out uint out_id_plus_one;

#ifdef ALBEDO
layout(location = 1) out vec4 out_albedo;
#endif

#if defined(HOLES) || defined(ALBEDO)
uniform vec4 u_base_color;
uniform sampler2D u_texture;  // white where the material has none
in vec2 v_texture_coordinate;
in vec4 v_color;
#endif

#ifdef HOLES
uniform float u_alpha_cutoff;
#endif

void main() {
#if defined(HOLES) || defined(ALBEDO)
    vec4 color = u_base_color * v_color * texture(u_texture, v_texture_coordinate);
#endif
#ifdef HOLES
    if (color.a < u_alpha_cutoff) discard;
#endif
    out_id_plus_one = u_first_plus_one + uint(gl_PrimitiveID);
#ifdef ALBEDO
    out_albedo = vec4(sqrt(color.rgb), 1.0);
#endif
}
