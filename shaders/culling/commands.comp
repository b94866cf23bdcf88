// Front-to-back draw commands of the visible clusters of one range and one camera, by a stable
// counting sort of distances. One work group per range and camera; a range is part of one bucket.
// Consecutive clusters of a group that are visible in a tile and in the same bin form a run, which
// is one command: drivers spend more time on a command than on a few triangles. The order of
// clusters within a tile does not change.
#version 450 core

#define THREADS 32u
layout(local_size_x = 32) in;

#include "culling/views.glsl"
#include "culling/bounds.glsl"
#ifdef TRIANGLES
#include "culling/pairs.glsl"
#endif

struct Command {  // arguments of glMultiDrawElementsIndirect
    uint indices, instances, first_index, base_vertex, base_instance;
};

struct Range {  // range of a bucket's clusters
    uint first_group, groups, first_command, most_commands;  // commands: per band
};

layout(std430, binding = 7) writeonly buffer Commands { Command commands[]; };
layout(std430, binding = 8) buffer Counts { uint counts[]; };  // commands: [pass][band][range]
layout(std430, binding = 9) readonly buffer CommandRanges { Range ranges[]; };

shared uint s_counts[BINS * THREADS];  // [bin][thread]
shared uint s_sums[THREADS];
shared uint s_first[2];  // first command by band, without those of the previous band

struct Child {
    uint cluster;
    uint bin;
    uint tiles;  // one word of the tiles where the child is visible
};

const Child NONE = Child(0xFFFFFFFEu, BINS, 0u);

Child child_at(uint cluster, uint camera, uint word) {
    uint at = camera * u_clusters + cluster;
    return Child(cluster, bins[at], visible_tiles[at * tile_words() + word]);
}

// Tiles in which a child begins a run, given the previous visible child.
uint run_starts(Child child, Child before) {
#ifdef TRIANGLES
    return child.tiles;  // each has its own triangles
#else
    bool follows = child.cluster == before.cluster + 1u && child.bin == before.bin;
    return follows ? child.tiles & ~before.tiles : child.tiles;
#endif
}

void main() {
    uint thread = gl_LocalInvocationID.x, camera = gl_WorkGroupID.y;
    uint number = u_first_range + gl_WorkGroupID.x;
    Range range = ranges[number];
    uint last = range.first_group + range.groups, words = tile_words();
    // compilers do not unroll loops that begin at the thread, and so have less to compile
    for (uint at = thread; at < BINS * THREADS; at += THREADS) s_counts[at] = 0u;
    for (uint group = range.first_group + thread; group < last; group += THREADS) {
        uint visible = visible_of_group[camera * u_groups + group];
        if (visible == 0u) continue;
        uint first_child = group_at(group).first_cluster;
        for (uint word = 0u; word < words; ++word) {
            Child before = NONE;
            for (uint children = visible; children != 0u; children &= children - 1u) {
                Child child = child_at(first_child + uint(findLSB(children)), camera, word);
                s_counts[child.bin * THREADS + thread] += uint(bitCount(run_starts(child, before)));
                before = child;
            }
        }
    }
    memoryBarrierShared();
    barrier();
    // each thread sums a run of the counts, one thread sums the runs
    uint sum = 0u;
    for (uint at = thread * BINS; at < (thread + 1u) * BINS; ++at) {
        uint count = s_counts[at];
        s_counts[at] = sum;
        sum += count;
    }
    s_sums[thread] = sum;
    memoryBarrierShared();
    barrier();
    if (thread == 0u) {
        uint total = 0u;
        for (uint at = thread; at < THREADS; ++at) {
            uint count = s_sums[at];
            s_sums[at] = total;
            total += count;
        }
        // the order of cameras has no effect: they share no texels of the atlas
        uint near = s_sums[FAR_BIN * THREADS / BINS];
        uint count = BANDS * u_pass * u_ranges + number;
        s_first[0] = range.first_command;
        s_first[1] = range.first_command + range.most_commands - near;
        if (near > 0u) s_first[0] += atomicAdd(counts[count], near);
        if (total > near) s_first[1] += atomicAdd(counts[count + u_ranges], total - near);
    }
    memoryBarrierShared();
    barrier();
    for (uint group = range.first_group + thread; group < last; group += THREADS) {
        uint visible = visible_of_group[camera * u_groups + group];
        if (visible == 0u) continue;
        visible_of_group[camera * u_groups + group] = 0u;  // for the next pass
        Group self = group_at(group);
        for (uint word = 0u; word < words; ++word) {
            uint first_instance = (self.object * u_cameras + camera) * u_tiles + 32u * word;
            Child before = NONE;
            for (uint children = visible; children != 0u; children &= children - 1u) {
                uint index = uint(findLSB(children));
                Child child = child_at(self.first_cluster + index, camera, word);
                uint place = child.bin * THREADS + thread;
                uint command = s_counts[place] + s_sums[place / BINS]
                    + s_first[child.bin < FAR_BIN ? 0u : 1u];
                uvec2 first = index_ranges[child.cluster];
                uint starts = run_starts(child, before);
                s_counts[place] += uint(bitCount(starts));
                for (; starts != 0u; starts &= starts - 1u) {
                    uint tile = uint(findLSB(starts)), indices = first.y;
#ifdef TRIANGLES
                    uint left = pairs[pair_of(camera * u_tiles + 32u * word + tile, child.cluster)];
                    first.x = 3u * (left >> COUNT_BITS);
                    indices = 3u * (left & ((1u << COUNT_BITS) - 1u));
#else
                    for (uint next = index + 1u; next < 32u; ++next) {
                        if ((visible >> next & 1u) == 0u) break;
                        Child follower = child_at(self.first_cluster + next, camera, word);
                        if (follower.bin != child.bin || (follower.tiles >> tile & 1u) == 0u) break;
                        indices += index_ranges[follower.cluster].y;
                    }
#endif
                    commands[command++] =
                        Command(indices, 1u, first.x, 0u, first_instance + tile);
                }
                visible_tiles[(camera * u_clusters + child.cluster) * words + word] = 0u;
                before = child;
            }
        }
    }
}
