// Triangle ID of a texel, plus 1, see visibility_pass.py; 0: nothing visible.
// With ALPHA_MASK, only where alpha reaches the cutoff; blended surfaces have a cutoff, too.
// With ALBEDO, also the square root of the plain base color: 8 bits are then as fine as sRGB.
// With MATERIALS, also roughness, metalness and emission, see gloss.glsl.
#version 450 core

#include "scene/material.glsl"

flat in uint v_first_plus_one;
in vec4 v_color;
layout(location = 0) out uint out_id_plus_one;

#ifdef ALBEDO
#define ALBEDO_OUTPUTS 1
layout(location = 1) out vec4 out_albedo;

void write_albedo(vec3 color) {
    out_albedo = vec4(sqrt(color), 1.0);
}
#else
#define ALBEDO_OUTPUTS 0

void write_albedo(vec3 color) {}
#endif
#include "ground_truth/gloss.glsl"

void main() {
    vec4 color = v_color * texture_color();
    write_gloss();
    discard_hole(color.a);
    out_id_plus_one = v_first_plus_one + uint(gl_PrimitiveID);
    write_albedo(color.rgb);
}
