// Copy of the deformed vertices' positions to the table of triangles (ground_truth/tables.glsl).
#version 450 core

layout(local_size_x = 64) in;

layout(std430, binding = 0) readonly buffer Vertices { uint vertex_words[]; };
layout(std430, binding = 1) readonly buffer Corners { uvec2 corners[]; };  // table entry, vertex
layout(rgba32ui, binding = 0) uniform uimage2D u_corners;

const uint VERTEX_WORDS = 10u, ROW_BITS = 12u;

uniform uint u_count;

void main() {
    uint index = gl_GlobalInvocationID.x;
    if (index >= u_count) return;
    uint entry = corners[index].x, at = VERTEX_WORDS * corners[index].y;
    ivec2 place = ivec2(entry & ((1u << ROW_BITS) - 1u), entry >> ROW_BITS);
    uint neighbor = imageLoad(u_corners, place).w;
    uvec3 position = uvec3(vertex_words[at], vertex_words[at + 1u], vertex_words[at + 2u]);
    imageStore(u_corners, place, uvec4(position, neighbor));
}
