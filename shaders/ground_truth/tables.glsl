// Tables of triangles and draw items, as textures: software drivers fetch textures faster than they
// read buffers by index.
// uvec4 corner_at(uint index): position of an entry of the index buffer, as float bits in the
//     mesh's frame, and the triangle beyond the opposite edge.
// uvec4 draw_item_at(uint item): first index of a draw item, flags, and two unused entries.
// vec4[3] matrix_at(uint item, uint which): rows of one of a draw item's matrices.
// uvec2 primitive_at(uint triangle_id): 1 + draw item, and triangle in it; 0 for ID 0.
// With BATCH, each image has its own draw items; the entry after the last one is its camera.
// The layout is that of geometry_store.py, ray_hit_pass.py and visibility_pass.py.

uniform usampler2D u_corners;
uniform usampler2D u_draw_items;
uniform usampler2D u_primitives;

const uint ROW_BITS = 12u;  // entries per row of any table
const uint ITEM_ENTRIES = 8u;
// Offsets of an item's matrices from its first entry.
const uint VIEWPOINT_FROM_MESH = 1u, SECOND_MATRIX = 4u;
const uint MASKED = 1u, DOUBLE_SIDED = 2u, FLIPS_WINDING = 4u;  // flags

#ifdef BATCH
uniform uint u_draw_item_count;  // draw items per image, camera included

uint first_entry_of(uint item) {
    return ITEM_ENTRIES * (uint(v_image) * u_draw_item_count + item);
}
#else
uint first_entry_of(uint item) {
    return ITEM_ENTRIES * item;
}
#endif

uvec4 entry_at(usampler2D entries, uint at) {
    return texelFetch(entries, ivec2(at & ((1u << ROW_BITS) - 1u), at >> ROW_BITS), 0);
}

uvec4 corner_at(uint index) {
    return entry_at(u_corners, index);
}

uvec4 draw_item_at(uint item) {
    return entry_at(u_draw_items, first_entry_of(item));
}

vec4[3] matrix_at(uint item, uint which) {
    uint first = first_entry_of(item) + which;
    return vec4[3](
        uintBitsToFloat(entry_at(u_draw_items, first)),
        uintBitsToFloat(entry_at(u_draw_items, first + 1u)),
        uintBitsToFloat(entry_at(u_draw_items, first + 2u)));
}

vec3 transformed(vec4 rows[3], vec4 point) {
    return vec3(dot(rows[0], point), dot(rows[1], point), dot(rows[2], point));
}

uvec2 primitive_at(uint triangle_id) {
    return triangle_id == 0u ? uvec2(0u) : entry_at(u_primitives, triangle_id - 1u).xy;
}
