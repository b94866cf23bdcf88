// Depth of shadow casters. With ALPHA_MASK only where alpha reaches the cutoff, which blended
// surfaces have too.
#version 450 core

#include "scene/material.glsl"

in float v_alpha;

void main() {
    discard_hole(v_alpha * texture_color().a);
}
