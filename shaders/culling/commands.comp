// Draw commands of the visible clusters of one bucket and one camera, near ones first: a stable
// counting sort by distance. One work group for each bucket and camera.
#version 430 core

#define THREADS 32u
layout(local_size_x = 32) in;

#include "culling/views.glsl"

struct Command {  // of glMultiDrawElementsIndirect
    uint indices, instances, first_index, base_vertex, base_instance;
};

struct Bucket {
    uint first_group, groups, first_command, most_commands;  // of a band
};

layout(std430, binding = 7) writeonly buffer Commands { Command commands[]; };
layout(std430, binding = 8) buffer Counts { uint counts[]; };  // of commands: [pass][band][bucket]
layout(std430, binding = 9) readonly buffer Buckets { Bucket buckets[]; };

shared uint s_counts[BINS * THREADS];  // [bin][thread]
shared uint s_sums[THREADS];
shared uint s_first[2];  // by band, without the commands of the band before

void main() {
    uint thread = gl_LocalInvocationID.x, camera = gl_WorkGroupID.y;
    Bucket bucket = buckets[gl_WorkGroupID.x];
    uint last = bucket.first_group + bucket.groups, words = tile_words();
    for (uint bin = 0u; bin < BINS; ++bin) s_counts[bin * THREADS + thread] = 0u;
    for (uint group = bucket.first_group + thread; group < last; group += THREADS) {
        uint children = visible_of_group[camera * u_groups + group];
        uint first_cluster = camera * u_clusters + groups[group].first_cluster;
        for (; children != 0u; children &= children - 1u) {
            uint at = first_cluster + uint(findLSB(children)), tiles = 0u;
            for (uint word = 0u; word < words; ++word)
                tiles += uint(bitCount(visible_tiles[at * words + word]));
            s_counts[bins[at] * THREADS + thread] += tiles;
        }
    }
    barrier();
    // each thread sums a run of the counts, one sums the runs
    uint sum = 0u;
    for (uint at = thread * BINS; at < (thread + 1u) * BINS; ++at) {
        uint count = s_counts[at];
        s_counts[at] = sum;
        sum += count;
    }
    s_sums[thread] = sum;
    barrier();
    if (thread == 0u) {
        uint total = 0u;
        for (uint at = 0u; at < THREADS; ++at) {
            uint count = s_sums[at];
            s_sums[at] = total;
            total += count;
        }
        // the order of cameras, which share nothing in the atlas, does not show
        uint near = s_sums[FAR_BIN * THREADS / BINS];
        uint count = BANDS * u_pass * u_buckets + gl_WorkGroupID.x;
        s_first[0] = bucket.first_command;
        s_first[1] = bucket.first_command + bucket.most_commands - near;
        if (near > 0u) s_first[0] += atomicAdd(counts[count], near);
        if (total > near) s_first[1] += atomicAdd(counts[count + u_buckets], total - near);
    }
    barrier();
    for (uint group = bucket.first_group + thread; group < last; group += THREADS) {
        uint children = visible_of_group[camera * u_groups + group];
        visible_of_group[camera * u_groups + group] = 0u;  // for the next pass
        uint first_cluster = groups[group].first_cluster;
        for (; children != 0u; children &= children - 1u) {
            uint cluster = first_cluster + uint(findLSB(children));
            uint at = camera * u_clusters + cluster, place = bins[at] * THREADS + thread;
            uint band = bins[at] < FAR_BIN ? 0u : 1u;
            uint command = s_first[band] + s_sums[place / BINS] + s_counts[place];
            Command own = Command(
                clusters[cluster].indices, 1u, clusters[cluster].first_index, 0u, 0u);
            uint first_instance = (clusters[cluster].object * u_cameras + camera) * u_tiles;
            for (uint word = 0u; word < words; ++word) {
                uint tiles = visible_tiles[at * words + word];
                visible_tiles[at * words + word] = 0u;
                s_counts[place] += uint(bitCount(tiles));
                for (; tiles != 0u; tiles &= tiles - 1u) {
                    own.base_instance = first_instance + 32u * word + uint(findLSB(tiles));
                    commands[command++] = own;
                }
            }
        }
    }
}
