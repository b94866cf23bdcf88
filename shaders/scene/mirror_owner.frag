// Number of the mirror that a texel shows, counted from 1; 0: a surface that is no planar mirror.
#version 450 core

layout(location = 0) out uint out_number;
uniform usampler2D u_numbers;   // by triangle
uniform int u_first_triangle;   // place of the draw call's first triangle

void main() {
    int triangle = u_first_triangle + gl_PrimitiveID, width = textureSize(u_numbers, 0).x;
    out_number = texelFetch(u_numbers, ivec2(triangle % width, triangle / width), 0).r;
}
