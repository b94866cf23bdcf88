// Depth of what casts shadows. With ALPHA_MASK only where alpha reaches the cutoff: a blended surface
// has one, too.
#version 450 core

#ifdef ALPHA_MASK
#include "scene/material.glsl"

in float v_alpha;
#ifdef TEXTURED
in vec2 v_texture_coordinate;
#endif
#endif

void main() {
#ifdef ALPHA_MASK
    float alpha = v_alpha;
#ifdef TEXTURED
    alpha *= texture_color(v_texture_coordinate).a;
#endif
    if (alpha < ALPHA_CUTOFF) discard;
#endif
}
