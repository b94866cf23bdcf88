// Triangle that covers the target; with LAYERED, each instance covers one of its layers.
#version 450 core
#ifdef LAYERED
#extension GL_ARB_shader_viewport_layer_array : require

flat out float v_layer;
#endif

void main() {
    vec2 corner = vec2((gl_VertexID << 1) & 2, gl_VertexID & 2);
    gl_Position = vec4(corner * 2.0 - 1.0, 0.0, 1.0);
#ifdef LAYERED
    gl_Layer = gl_InstanceID;
    v_layer = float(gl_InstanceID);
#endif
}
