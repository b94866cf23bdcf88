// Vertex of a shadow caster, see scene/vertex.glsl; with ALPHA_MASK, also the inputs of its holes.
#version 450 core

#include "scene/vertex.glsl"
#include "scene/vertex_material.glsl"

out float v_alpha;

void main() {
    gl_Position = clip_position();
    v_alpha = vertex_color().a;
    pass_material();
}
