// Upper bounds of the inverse depth over blocks of an atlas's texels, and over groups of blocks,
// for first_surface.glsl. Without DILATE, an invocation finds the largest of a block. With DILATE,
// it adds the neighbors of its block, and those of its group. The row below the blocks begins with
// the largest nearness of any surface.
#version 450 core

layout(local_size_x = 8, local_size_y = 8) in;

uniform sampler2D u_depth;  // reversed: 0 is empty

const int BLOCK = 8, BLOCKS_PER_GROUP = 8;  // per side, as in depth_pyramid.py

layout(std430, binding = 0) buffer Blocks { float inverse_z[]; };
layout(std430, binding = 1) buffer Groups {  // bits of floats >= 0
    uint nearest_bits;  // largest group
    uint group_bits[];
};

ivec2 count_of(int texels) {
    return (textureSize(u_depth, 0) + texels - 1) / texels;
}

int block_at(ivec2 block) {
    return block.y * count_of(BLOCK).x + block.x;
}

int group_at(ivec2 group) {
    return group.y * count_of(BLOCK * BLOCKS_PER_GROUP).x + group.x;
}

#ifdef DILATE
uniform double u_longest_m;  // greatest distance of a ray's origin from the viewpoint
uniform double u_near_m;
layout(rg32f, binding = 0) writeonly uniform image2D u_bounds;

void main() {
    ivec2 own = ivec2(gl_GlobalInvocationID.xy), last = count_of(BLOCK) - 1;
    if (any(greaterThan(own, last))) return;
    ivec2 last_group = count_of(BLOCK * BLOCKS_PER_GROUP) - 1;
    float largest = 0.0;
    uint largest_bits = 0u;
    for (int y = -1; y <= 1; ++y) {
        for (int x = -1; x <= 1; ++x) {
            ivec2 block = clamp(own + ivec2(x, y), ivec2(0), last);
            ivec2 group = clamp(own / BLOCKS_PER_GROUP + ivec2(x, y), ivec2(0), last_group);
            largest = max(largest, inverse_z[block_at(block)]);
            largest_bits = max(largest_bits, group_bits[group_at(group)]);
        }
    }
    imageStore(u_bounds, own, vec4(largest, uintBitsToFloat(largest_bits), 0.0, 0.0));
    if (own != ivec2(0)) return;
    // for rays that begin beside the viewpoint, but behind the near plane
    double nearest = double(uintBitsToFloat(nearest_bits));
    if (nearest > 0.0) nearest = 1.0 / max(1.0 / nearest - u_longest_m, u_near_m);
    imageStore(u_bounds, ivec2(0, last.y + 1), vec4(float(nearest), 0.0, 0.0, 0.0));
}
#else
uniform vec2 u_inverse_z_from_depth;  // factor and offset

void main() {
    ivec2 own = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(own, count_of(BLOCK)))) return;
    vec2 size = vec2(textureSize(u_depth, 0));
    vec4 depths = vec4(0.0);
    for (int y = 1; y < BLOCK; y += 2) {
        for (int x = 1; x < BLOCK; x += 2) {
            // four texels around a corner; those beyond the atlas repeat its edge
            vec2 corner = vec2(BLOCK * own + ivec2(x, y)) / size;
            depths = max(depths, textureGather(u_depth, corner));
        }
    }
    float depth = max(max(depths.x, depths.y), max(depths.z, depths.w));
    precise float largest = u_inverse_z_from_depth.x * depth + u_inverse_z_from_depth.y;
    if (depth <= 0.0) largest = 0.0;
    inverse_z[block_at(own)] = largest;
    uint bits = floatBitsToUint(largest);
    int group = group_at(own / BLOCKS_PER_GROUP);
    if (bits > group_bits[group]) atomicMax(group_bits[group], bits);
    if (bits > nearest_bits) atomicMax(nearest_bits, bits);
}
#endif
