// Depth of shadow casters. With ALPHA_MASK, only where alpha reaches the cutoff; blended surfaces
// have a cutoff, too.
#version 450 core

#include "scene/material.glsl"

in float v_alpha;

void main() {
    discard_hole(v_alpha * texture_color().a);
}
