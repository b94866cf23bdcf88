// Vertex of the scene, see scene/vertex.glsl, with the inputs of its lighting.
#version 450 core

#include "scene/vertex.glsl"
#include "scene/vertex_material.glsl"
#include "scene/vertex_light.glsl"
#include "scene/vertex_placement.glsl"
#include "scene/vertex_details.glsl"
#include "scene/mirror_clip.glsl"

#ifdef BAKED
flat
#endif
out vec4 v_color;  // base color, times light if that is baked

void main() {
    gl_Position = clip_position();
    v_color = vertex_color();
    pass_material();
    pass_light_coordinate();
    pass_placement();
    pass_details();
    clip_at_mirror();
}
