// Bounds of boxes on the screen, and tests of them: of a texel, and with PASS 2 of the depth of
// earlier passes.

layout(std430, binding = 2) readonly buffer Rectangles { vec4 rectangles_px[]; };  // [view]

// Bounds of a box on the screen.
struct Bounds {
    bool crosses;   // the box crosses the near plane; the bounds are the whole tile
    float nearest;  // nearest depth of the box
    vec2 first_px, last_px;  // first and last texels of the tile whose centers the box covers
};

Bounds bounds_of(ClipBox box, vec2 size_px) {
    vec2 low = vec2(1e30), high = vec2(-1e30);
    float nearest_m = 1e30;
    for (int corner = 0; corner < 8; ++corner) {
        vec3 signs = vec3(corner & 1, (corner >> 1) & 1, corner >> 2) * 2.0 - 1.0;
        float w = box.center.z + dot(box.w_edges, signs);
        nearest_m = min(nearest_m, w);
        vec2 at = vec2(dot(box.x_edges, signs), dot(box.y_edges, signs));
        at = (box.center.xy + at) / max(w, u_depths_m.x);
        low = min(low, at);
        high = max(high, at);
    }
    // a texel is covered if its center is, which is half a texel from its edge
    Bounds bounds;
    bounds.crosses = nearest_m < u_depths_m.x;
    bounds.nearest = u_depth.x + u_depth.y / nearest_m;
    // at most a texel outside the tile, so that the values fit into integers
    bounds.first_px =
        clamp(ceil(0.5 * size_px * (low + 1.0) - (0.5 + u_radius_px)), vec2(0.0), size_px);
    bounds.last_px = clamp(
        floor(0.5 * size_px * (high + 1.0) - (0.5 - u_radius_px)), vec2(-1.0), size_px - 1.0);
    return bounds;
}

bool covers_texel(Bounds bounds) {
    return bounds.crosses || all(lessThanEqual(bounds.first_px, bounds.last_px));
}

#if PASS == 2
#include "culling/hi_z.glsl"
layout(std430, binding = 11) readonly buffer HiZ { float farthest[]; };

const float DEPTH_TOLERANCE = 1e-4;  // relative depth within which geometry behind another is drawn
const int MAX_CELLS = 4;             // tested cells per side

// True if the depth in all covered cells is nearer than the whole box.
bool is_occluded(Bounds bounds, vec2 corner_px, uint camera) {
    if (bounds.crosses) return false;
    ivec2 first_px = ivec2(corner_px + bounds.first_px);
    ivec2 last_px = ivec2(corner_px + bounds.last_px);
    uvec2 groups = last_cells();
    uint start = camera * groups.x * groups.y * CELLS;
    int level = 0;
    ivec2 first = first_px / CELL_PX, last = last_px / CELL_PX;
    while (any(greaterThanEqual(last - first, ivec2(MAX_CELLS)))) {
        if (level == LEVELS - 1) return false;
        uint side = uint(SIDE >> level);
        start += groups.x * groups.y * side * side;
        ++level;
        first >>= 1;
        last >>= 1;
    }
    uint columns = groups.x * uint(SIDE >> level);
    float limit = bounds.nearest * (1.0 + DEPTH_TOLERANCE);
    for (int y = first.y; y <= last.y; ++y)
        for (int x = first.x; x <= last.x; ++x)
            if (farthest[start + uint(y) * columns + uint(x)] <= limit) return false;
    return true;
}

// The same, roughly: of at most 2 × 2 cells, without a loop.
bool is_small_occluded(Bounds bounds, vec2 corner_px, uint camera) {
    ivec2 first = ivec2(corner_px + bounds.first_px) / CELL_PX;
    ivec2 last = ivec2(corner_px + bounds.last_px) / CELL_PX;
    ivec2 across = last - first;
    int level = findMSB(max(across.x, across.y)) + 1;
    if (level >= LEVELS) return false;
    first >>= level;
    last >>= level;
    uvec2 groups = last_cells();
    uint side = uint(SIDE >> level), columns = groups.x * side;
    uint start = groups.x * groups.y
        * (camera * CELLS + (4u * uint(SIDE * SIDE) - 4u * side * side) / 3u);
    uvec2 rows = start + uvec2(first.y, last.y) * columns;
    float least = min(
        min(farthest[rows.x + uint(first.x)], farthest[rows.x + uint(last.x)]),
        min(farthest[rows.y + uint(first.x)], farthest[rows.y + uint(last.x)]));
    return least > bounds.nearest * (1.0 + DEPTH_TOLERANCE);
}
#endif
