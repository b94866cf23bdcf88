// Draw commands of the visible clusters of one bucket and one camera, near ones first: a stable
// counting sort by distance. One work group for each bucket and camera.
#version 430 core

#define THREADS 64u
#define BINS 32u
layout(local_size_x = 64) in;

#include "culling/views.glsl"

struct Command {  // of glMultiDrawElementsIndirect
    uint indices, instances, first_index, base_vertex, base_instance;
};

struct Bucket {
    uint first_cluster, clusters, first_command, unused;
};

layout(std430, binding = 7) writeonly buffer Commands { Command commands[]; };
layout(std430, binding = 8) buffer Counts { uint counts[]; };  // of commands: [bucket]
layout(std430, binding = 9) readonly buffer Buckets { Bucket buckets[]; };

shared uint s_counts[BINS * THREADS];  // [bin][thread]
shared uint s_sums[THREADS];
shared uint s_first;

// Distances double every two bins.
const float NEAREST_M = 0.25;

uint bin_of(Cluster cluster, uint camera) {
    vec4 rows[3] = instances[cluster.object * u_cameras * u_tiles + camera * u_tiles]
        .viewpoint_from_object;
    vec3 centre = 0.5 * (cluster.aabb_min + cluster.aabb_max);
    float far_m = length(centre - viewpoint_of(rows)) + length(cluster.aabb_max - centre);
    return uint(clamp(2.0 * log2(far_m / NEAREST_M), 0.0, float(BINS - 1u)));
}

void main() {
    uint thread = gl_LocalInvocationID.x, camera = gl_WorkGroupID.y;
    Bucket bucket = buckets[gl_WorkGroupID.x];
    uint views = u_cameras * u_tiles, last = bucket.first_cluster + bucket.clusters;
    for (uint bin = 0u; bin < BINS; ++bin) s_counts[bin * THREADS + thread] = 0u;
    for (uint at = bucket.first_cluster + thread; at < last; at += THREADS) {
        uint group = clusters[at].group;
        uint bit = at - groups[group].first_cluster;
        uint first = (camera * u_groups + group) * u_tiles, seen = 0u;
        for (uint tile = 0u; tile < u_tiles; ++tile) seen += (masks[first + tile] >> bit) & 1u;
        if (seen > 0u) s_counts[bin_of(clusters[at], camera) * THREADS + thread] += seen;
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
        s_first = bucket.first_command + (total > 0u ? atomicAdd(counts[gl_WorkGroupID.x], total) : 0u);
    }
    barrier();
    for (uint at = bucket.first_cluster + thread; at < last; at += THREADS) {
        uint group = clusters[at].group;
        uint bit = at - groups[group].first_cluster;
        uint first = (camera * u_groups + group) * u_tiles, seen = 0u;
        for (uint tile = 0u; tile < u_tiles; ++tile) seen += (masks[first + tile] >> bit) & 1u;
        if (seen == 0u) continue;
        uint place = bin_of(clusters[at], camera) * THREADS + thread;
        uint command = s_first + s_sums[place / BINS] + s_counts[place];
        s_counts[place] += seen;
        for (uint tile = 0u; tile < u_tiles; ++tile) {
            if (((masks[first + tile] >> bit) & 1u) == 0u) continue;
            commands[command++] = Command(
                clusters[at].indices, 1u, clusters[at].first_index, 0u,
                clusters[at].object * views + camera * u_tiles + tile);
        }
    }
}
