// Farthest depth in square cells of an atlas, whose sides double from level to level. Depth is
// reversed: the farthest is the smallest. With COARSE, levels 3 to 5 are computed from level 2;
// otherwise levels 0 to 2 from the depth buffer. An invocation computes a cell of the last of
// these levels and all cells in it, because software drivers are slow if invocations wait for each
// other. Source: hierarchical z buffers, Greene, Kass & Miller 1993.
#version 450 core

#include "culling/settings.glsl"
#include "culling/hi_z.glsl"

layout(local_size_x = 8, local_size_y = 8) in;

layout(std430, binding = 11) buffer HiZ { float farthest[]; };
// With LAYERED, each camera has a layer, and an invocation's z is the camera's index.

uint place(uvec2 cell, int level) {
    uvec2 cells = last_cells();
    uint first = gl_GlobalInvocationID.z * cells.x * cells.y * CELLS;
    for (int below = 0; below < level; ++below)
        first += cells.x * cells.y * uint(SIDE >> below) * uint(SIDE >> below);
    return first + cell.y * cells.x * uint(SIDE >> level) + cell.x;
}

#ifdef COARSE
void main() {
    uvec2 own = gl_GlobalInvocationID.xy;
    if (any(greaterThanEqual(own, last_cells()))) return;
    float least = 1.0;
    for (uint quarter = 0u; quarter < 4u; ++quarter) {
        uvec2 cell = 2u * own + uvec2(quarter & 1u, quarter >> 1);
        float least_of_quarter = 1.0;
        for (uint part = 0u; part < 4u; ++part) {
            uvec2 smaller = 2u * cell + uvec2(part & 1u, part >> 1);
            uint at = place(2u * smaller, 2), below = at + last_cells().x * uint(SIDE >> 2);
            float least_of_part = min(
                min(farthest[at], farthest[at + 1u]), min(farthest[below], farthest[below + 1u]));
            farthest[place(smaller, 3)] = least_of_part;
            least_of_quarter = min(least_of_quarter, least_of_part);
        }
        farthest[place(cell, 4)] = least_of_quarter;
        least = min(least, least_of_quarter);
    }
    farthest[place(own, 5)] = least;
}
#else
#ifdef LAYERED
uniform sampler2DArray u_atlas_depth;
#define at_layer(uv) vec3(uv, float(gl_GlobalInvocationID.z))
#else
uniform sampler2D u_atlas_depth;
#define at_layer(uv) uv
#endif

// Farthest depth of the four texels around a corner; texels at the edge repeat.
float around(uvec2 corner) {
    vec2 size = vec2(textureSize(u_atlas_depth, 0).xy);
    vec4 depths = textureGather(u_atlas_depth, at_layer(vec2(corner) / size));
    return min(min(depths.x, depths.y), min(depths.z, depths.w));
}

void main() {
    uvec2 own = gl_GlobalInvocationID.xy;
    if (any(greaterThanEqual(own, last_cells() * uint(SIDE >> 2)))) return;
    float least = 1.0;
    for (uint quarter = 0u; quarter < 4u; ++quarter) {
        uvec2 cell = 2u * own + uvec2(quarter & 1u, quarter >> 1), first = 2u * cell;
        vec4 depths = vec4(
            around(2u * first + 1u), around(2u * first + uvec2(3u, 1u)),
            around(2u * first + uvec2(1u, 3u)), around(2u * first + 3u));
        uint at = place(first, 0), below = at + last_cells().x * uint(SIDE);
        farthest[at] = depths.x;
        farthest[at + 1u] = depths.y;
        farthest[below] = depths.z;
        farthest[below + 1u] = depths.w;
        float least_of_cell = min(min(depths.x, depths.y), min(depths.z, depths.w));
        farthest[place(cell, 1)] = least_of_cell;
        least = min(least, least_of_cell);
    }
    farthest[place(own, 2)] = least;
}
#endif
