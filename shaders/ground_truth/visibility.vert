// Vertex of the scene, see scene/vertex.glsl, with its triangle ID.
#version 450 core
#ifdef CLUSTERED
#extension GL_ARB_shader_draw_parameters : require
#endif

#include "scene/vertex.glsl"
#include "scene/vertex_material.glsl"
#include "scene/vertex_details.glsl"

out vec4 v_color;
flat out uint v_first_plus_one;  // 1 + ID of the draw call's first triangle

#ifdef CLUSTERED
layout(std430, binding = 7) readonly buffer Commands { uint commands[]; };
uniform uint u_first_command;  // first command of the multi-draw
const uint COMMAND_WORDS = 5u, FIRST_INDEX_WORD = 2u;

uint first_triangle() {
    uint command = u_first_command + uint(gl_DrawIDARB);
    return commands[COMMAND_WORDS * command + FIRST_INDEX_WORD] / 3u;
}
#else
uint first_triangle() {
    return 0u;
}
#endif
uniform uint u_first_plus_one;

void main() {
    gl_Position = clip_position();
    v_first_plus_one = u_first_plus_one + first_triangle();
    v_color = vertex_color();
    pass_material();
    pass_details();
}
