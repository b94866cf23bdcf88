// A triangle that covers a tile, and the directions that it sees.
// u_direction_from_clip  axes of the world; of LAYERED, of the rig
// With LAYERED each instance is a camera, with a layer of the target.
#version 450 core
#ifdef LAYERED
#extension GL_ARB_shader_viewport_layer_array : require
layout(std430, binding = 15) readonly buffer Rigs { mat4 world_from_rig[]; };
#endif

uniform mat3 u_direction_from_clip;
out vec3 v_direction;

void main() {
    vec2 corner = 2.0 * vec2((gl_VertexID << 1) & 2, gl_VertexID & 2) - 1.0;
    v_direction = u_direction_from_clip * vec3(corner, 1.0);
#ifdef LAYERED
    v_direction = mat3(world_from_rig[gl_InstanceID]) * v_direction;
    gl_Layer = gl_InstanceID;
#endif
    gl_Position = vec4(corner, 0.0, 1.0);
}
