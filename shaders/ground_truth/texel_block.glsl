// uint[TEXELS] ids_around(ivec2 texel): triangle IDs of the 3 × 3 texels around a texel; 0: none.
// uint id_at(ivec2 texel): triangle ID of a texel; with BATCH, in the image's own layer.
// uint distinct_texels(uint ids[TEXELS]): bit mask of the texels whose triangle no earlier texel
//     shows. Bit 0 is the block's middle, then all texels follow row by row. The middle comes first
//     because its triangle is the likeliest hit, which shortens the search.

// Output of visibility.frag.
#ifdef BATCH
uniform usampler2DArray u_triangle_ids;
#else
uniform usampler2D u_triangle_ids;
#endif

const int WIDTH = 3;
const uint TEXELS = uint(WIDTH * WIDTH), OWN = TEXELS / 2u;

ivec2 texel_offset(uint at) {
    return ivec2(int(at) % WIDTH, int(at) / WIDTH) - WIDTH / 2;
}

uint id_at(ivec2 texel) {
#ifdef BATCH
    return texelFetch(u_triangle_ids, ivec3(texel, v_image), 0).x;
#else
    return texelFetch(u_triangle_ids, texel, 0).x;
#endif
}

uint[TEXELS] ids_around(ivec2 texel) {
    uint ids[TEXELS];
    for (uint at = 0u; at < TEXELS; ++at)
        ids[at] = id_at(texel + texel_offset(at));
    return ids;
}

uint distinct_texels(uint ids[TEXELS]) {
    uint distinct = ids[OWN] == 0u ? 0u : 1u;
    for (uint at = 0u; at < TEXELS; ++at) {
        uint id = ids[at];
        bool is_new = id != 0u && id != ids[OWN];
        uint row = at / uint(WIDTH), column = at % uint(WIDTH);
        if (column > 0u) is_new = is_new && id != ids[at - 1u];
        if (row > 0u) is_new = is_new && id != ids[at - uint(WIDTH)];
        if (row > 0u && column < uint(WIDTH) - 1u)
            is_new = is_new && id != ids[at - uint(WIDTH) + 1u];
        if (is_new) distinct |= 2u << at;
    }
    return distinct;
}
