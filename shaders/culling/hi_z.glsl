// Levels of a hierarchical z buffer: cells of 4, 8, 16, 32 and 64 texels to a side.

#define CELL_PX 4
#define LEVELS 5
#define CELLS 341u  // of all levels, in one of the last
#define SIDE 16  // cells of the first level in one of the last

// Numbers of cells of the last level, of an atlas.
uvec2 last_cells() {
    return (uvec2(u_atlas_px) + uint(CELL_PX * SIDE - 1)) / uint(CELL_PX * SIDE);
}
