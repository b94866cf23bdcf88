// Levels of a hierarchical z buffer, with cells of 2, 4, 8, 16, 32 and 64 texels per side.

#define CELL_PX 2
#define LEVELS 6
#define CELLS 1365u  // cells of all levels per cell of the last level
#define SIDE 32     // cells of the first level along a side of a cell of the last level

// Number of cells of the last level in an atlas.
uvec2 last_cells() {
    return (uvec2(u_atlas_px) + uint(CELL_PX * SIDE - 1)) / uint(CELL_PX * SIDE);
}
