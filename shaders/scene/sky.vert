// Rectangle that covers a tile, with view directions in world axes. Each instance is a tile.
// With LAYERED, the tiles of all cameras follow each other; a camera has a layer of the target.
#version 450 core
#ifdef LAYERED
#extension GL_ARB_shader_viewport_layer_array : require
uniform int u_tiles;  // tiles per camera
#endif

in mat3 in_direction_from_corner;
in vec4 in_placement;  // scale and shift of the tile in the atlas's clip space

out vec3 v_direction;
out float gl_ClipDistance[4];  // unused: the tile ends where the rectangle does

void main() {
    vec2 corner = 2.0 * vec2(gl_VertexID & 1, gl_VertexID >> 1) - 1.0;
    v_direction = in_direction_from_corner * vec3(corner, 1.0);
    gl_Position = vec4(corner * in_placement.xy + in_placement.zw, 0.0, 1.0);
    for (int side = 0; side < 4; side++) gl_ClipDistance[side] = 1.0;
#ifdef LAYERED
    gl_Layer = gl_InstanceID / u_tiles;
#endif
}
