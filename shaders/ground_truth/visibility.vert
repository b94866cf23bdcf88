// Vertex of the scene, see scene/vertex.glsl; with COLORED also its color, and with REFLECTANCE details.
#version 450 core
#ifdef CLUSTERED
#extension GL_ARB_shader_draw_parameters : require
#endif

#include "scene/vertex.glsl"

#if defined(TEXTURED) || defined(TEXTURE_COORDINATES)
layout(location = 2) in vec2 in_texture_coordinate;
out vec2 v_texture_coordinate;
#endif
#ifdef COLORED
layout(location = 3) in vec4 in_color;
out vec4 v_color;
#endif

flat out uint v_first_plus_one;  // 1 + ID of the call's first triangle
#ifdef CLUSTERED
#if defined(TEXTURED) || defined(ALPHA_MASK)
layout(location = 4) in vec2 in_material;
flat out vec2 v_material;
#endif
layout(std430, binding = 7) readonly buffer Commands { uint commands[]; };
uniform uint u_first_command;  // of the multi-draw
const uint COMMAND_WORDS = 5u, FIRST_INDEX_WORD = 2u;
#else
uniform vec4 u_base_color;
#endif
uniform uint u_first_plus_one;
#ifdef REFLECTANCE
#include "scene/vertex_details.glsl"
#endif

void main() {
    gl_Position = clip_position();
    v_first_plus_one = u_first_plus_one;
#ifdef REFLECTANCE
    pass_details();
#endif
#ifdef CLUSTERED
    uint command = u_first_command + uint(gl_DrawIDARB);
    v_first_plus_one += commands[COMMAND_WORDS * command + FIRST_INDEX_WORD] / 3u;
#endif
#if defined(TEXTURED) || defined(TEXTURE_COORDINATES)
    v_texture_coordinate = in_texture_coordinate;
#endif
#if defined(CLUSTERED) && (defined(TEXTURED) || defined(ALPHA_MASK))
    v_material = in_material;
#endif
#ifdef COLORED
    v_color = in_color;
#ifndef CLUSTERED
    v_color *= u_base_color;
#endif
#endif
}
