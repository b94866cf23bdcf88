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
    uint first_cluster, clusters, first_command, unused;
};

layout(std430, binding = 7) writeonly buffer Commands { Command commands[]; };
layout(std430, binding = 8) buffer Counts { uint counts[]; };  // of commands: [pass][bucket]
layout(std430, binding = 9) readonly buffer Buckets { Bucket buckets[]; };

shared uint s_counts[BINS * THREADS];  // [bin][thread]
shared uint s_sums[THREADS];
shared uint s_first;

void main() {
    uint thread = gl_LocalInvocationID.x, camera = gl_WorkGroupID.y;
    Bucket bucket = buckets[gl_WorkGroupID.x];
    uint last = bucket.first_cluster + bucket.clusters, words = tile_words();
    for (uint bin = 0u; bin < BINS; ++bin) s_counts[bin * THREADS + thread] = 0u;
    for (uint at = bucket.first_cluster + thread; at < last; at += THREADS) {
        uint first = (camera * u_clusters + at) * words, tiles = 0u;
        for (uint word = 0u; word < words; ++word) tiles += uint(bitCount(visible_tiles[first + word]));
        if (tiles > 0u) s_counts[bins[camera * u_clusters + at] * THREADS + thread] += tiles;
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
        uint count = u_pass * u_buckets + gl_WorkGroupID.x;
        s_first = bucket.first_command;
        if (total > 0u) s_first += atomicAdd(counts[count], total);
    }
    barrier();
    for (uint at = bucket.first_cluster + thread; at < last; at += THREADS) {
        uint first = (camera * u_clusters + at) * words;
        for (uint word = 0u; word < words; ++word) {
            uint tiles = visible_tiles[first + word];
            if (tiles == 0u) continue;
            visible_tiles[first + word] = 0u;  // for the next pass
            uint place = bins[camera * u_clusters + at] * THREADS + thread;
            uint command = s_first + s_sums[place / BINS] + s_counts[place];
            s_counts[place] += uint(bitCount(tiles));
            Command own = Command(
                clusters[at].indices, 1u, clusters[at].first_index, 0u,
                (clusters[at].object * u_cameras + camera) * u_tiles + 32u * word);
            uint first_instance = own.base_instance;
            for (; tiles != 0u; tiles &= tiles - 1u) {
                own.base_instance = first_instance + uint(findLSB(tiles));
                commands[command++] = own;
            }
        }
    }
}
