// Table of the bounds of groups, clusters and blocks, as a texture: software drivers fetch textures
// faster than buffers. The layout is that of omnisim/rendering/opengl/culling/cluster_culling.py.
// Group group_at(uint index), Cluster cluster_at(uint index), Block block_at(uint index).

uniform usampler2D u_bounds;

const float BOTH_SIDES = 2.5;
const uint ROW_BITS = 12u;  // entries per row
const uint GROUP_ENTRIES = 3u, CLUSTER_ENTRIES = 3u, BLOCK_ENTRIES = 2u;

struct Group {
    vec3 aabb_min, aabb_max;
    uint first_cluster;
    uint object;
    float width;  // largest of its clusters' widths
};

struct Cluster {
    vec3 aabb_min, aabb_max;
    vec3 cone_axis;
    // above 1: from everywhere, at least one triangle faces the viewer; above BOTH_SIDES, all do
    float cone_sine;
    float width;      // width of the triangles, for occlusion
    uint object;
};

// Consecutive groups of one object.
struct Block {
    vec3 aabb_min, aabb_max;
    uint first_group, groups;
};

uvec4 entry_at(uint at) {
    return texelFetch(u_bounds, ivec2(at & ((1u << ROW_BITS) - 1u), at >> ROW_BITS), 0);
}

Group group_at(uint index) {
    uint first = GROUP_ENTRIES * index;
    uvec4 low = entry_at(first), high = entry_at(first + 1u);
    float width = uintBitsToFloat(entry_at(first + 2u).x);
    return Group(uintBitsToFloat(low.xyz), uintBitsToFloat(high.xyz), low.w, high.w, width);
}

Cluster cluster_at(uint index) {
    uint first = GROUP_ENTRIES * u_groups + CLUSTER_ENTRIES * index;
    vec4 low = uintBitsToFloat(entry_at(first)), high = uintBitsToFloat(entry_at(first + 1u));
    vec4 cone = uintBitsToFloat(entry_at(first + 2u));
    return Cluster(low.xyz, high.xyz, cone.xyz, cone.w, low.w, floatBitsToUint(high.w));
}

Block block_at(uint index) {
    uint first = GROUP_ENTRIES * u_groups + CLUSTER_ENTRIES * u_clusters + BLOCK_ENTRIES * index;
    uvec4 low = entry_at(first), high = entry_at(first + 1u);
    return Block(uintBitsToFloat(low.xyz), uintBitsToFloat(high.xyz), low.w, high.w);
}
