// Triangle that covers a tile, with view directions in world axes.
// With LAYERED, each instance is a camera, which has a layer of the target.
#version 450 core
#ifdef LAYERED
#extension GL_ARB_shader_viewport_layer_array : require
layout(std430, binding = 15) readonly buffer Directions { mat4 directions_from_clip[]; };
uniform int u_first_direction;  // index of the tile's first direction, for the first camera
#else
uniform mat3 u_direction_from_clip;
#endif

out vec3 v_direction;

void main() {
    vec2 corner = 2.0 * vec2((gl_VertexID << 1) & 2, gl_VertexID & 2) - 1.0;
#ifdef LAYERED
    mat3 direction_from_clip = mat3(directions_from_clip[u_first_direction + gl_InstanceID]);
    gl_Layer = gl_InstanceID;
#else
    mat3 direction_from_clip = u_direction_from_clip;
#endif
    v_direction = direction_from_clip * vec3(corner, 1.0);
    gl_Position = vec4(corner, 0.0, 1.0);
}
