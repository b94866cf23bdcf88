// What is looked up of triangles and draws, as textures: software drivers fetch those quicker than
// they read buffers, index by index.
// uvec4 corner_at(uint index): of an entry of the index buffer the position, as bits of floats, in
//     the frame of its mesh, and the triangle beyond the opposite edge.
// uvec4 draw_at(uint number): first index of a draw, bits of its kind, unused.
// vec4[3] matrix_at(uint number, uint which): rows of one of its matrices.
// uvec2 surface_at(uint number_plus_one): what is drawn with a number: 1 + number of the draw, number
//     of its triangle; 0 for 0.
// The layout is that in omnisim/gpu/ground_truth/triangle_table.py, lookup_records.py and numbered_geometry.py.

uniform usampler2D u_corners;
uniform usampler2D u_draws;
uniform usampler2D u_numbers;

const uint ROW_BITS = 12u;  // of entries in a row of either texture
const uint DRAW_ENTRIES = 8u;
// First entries of a draw's matrices, counted from its own.
const uint HERE_FROM_MESH = 1u, SECOND_MATRIX = 4u;

uvec4 entry_at(usampler2D entries, uint at) {
    return texelFetch(entries, ivec2(at & ((1u << ROW_BITS) - 1u), at >> ROW_BITS), 0);
}

uvec4 corner_at(uint index) {
    return entry_at(u_corners, index);
}

uvec4 draw_at(uint number) {
    return entry_at(u_draws, DRAW_ENTRIES * number);
}

vec4[3] matrix_at(uint number, uint which) {
    uint first = DRAW_ENTRIES * number + which;
    return vec4[3](
        uintBitsToFloat(entry_at(u_draws, first)),
        uintBitsToFloat(entry_at(u_draws, first + 1u)),
        uintBitsToFloat(entry_at(u_draws, first + 2u)));
}

uvec2 surface_at(uint number_plus_one) {
    return number_plus_one == 0u ? uvec2(0u) : entry_at(u_numbers, number_plus_one - 1u).xy;
}
