// Vertex of the scene, for one tile; with HOLES or ALBEDO also its colour. Uniforms as in scene/surface.vert.
#version 430 core

uniform mat4 u_clip_from_mesh;

in vec3 in_position;

#if defined(HOLES) || defined(ALBEDO)
in vec2 in_texture_coordinate;
in vec4 in_color;
out vec2 v_texture_coordinate;
out vec4 v_color;
#endif

void main() {
    gl_Position = u_clip_from_mesh * vec4(in_position, 1.0);
#if defined(HOLES) || defined(ALBEDO)
    v_texture_coordinate = in_texture_coordinate;
    v_color = in_color;
#endif
}
