// Farthest depth in square cells of an atlas, whose sides double from level to level. Depth is
// reversed: the farthest is the least. One work group for each cell of the last level.
// Source: hierarchical z buffers, Greene, Kass & Miller 1993.
#version 430 core

#include "culling/hi_z.glsl"

layout(local_size_x = SIDE, local_size_y = SIDE) in;

layout(std430, binding = 12) writeonly buffer HiZ { float farthest[]; };
uniform sampler2D u_depth;

shared float s_depths[SIDE * SIDE];

float farthest_in(ivec2 cell) {
    vec2 size = vec2(textureSize(u_depth, 0));
    vec4 least = vec4(1.0);
    for (int y = 1; y < CELL_PX; y += 2)
        for (int x = 1; x < CELL_PX; x += 2)
            // the four texels around a corner; at the edge they repeat
            least = min(least, textureGather(u_depth, vec2(cell * CELL_PX + ivec2(x, y)) / size));
    return min(min(least.x, least.y), min(least.z, least.w));
}

void main() {
    ivec2 own = ivec2(gl_LocalInvocationID.xy), cell = ivec2(gl_GlobalInvocationID.xy);
    uvec2 groups = gl_NumWorkGroups.xy;
    float least = farthest_in(cell);
    uint first = 0u;
    for (int level = 0; level < LEVELS; ++level) {
        int side = SIDE >> level;
        bool is_cell = all(lessThan(own, ivec2(side)));
        if (level > 0) {
            s_depths[own.y * SIDE + own.x] = least;
            barrier();
            if (is_cell) {
                int at = 2 * (own.y * SIDE + own.x);
                least = min(min(s_depths[at], s_depths[at + 1]),
                            min(s_depths[at + SIDE], s_depths[at + SIDE + 1]));
            }
            barrier();
        }
        if (is_cell) {
            uvec2 place = gl_WorkGroupID.xy * uint(side) + uvec2(own);
            farthest[first + place.y * groups.x * uint(side) + place.x] = least;
        }
        first += groups.x * groups.y * uint(side * side);
    }
}
