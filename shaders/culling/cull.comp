// Culling of the clusters of a candidate (a group in a view) that are outside the frustum,
// back-facing, or too small to cover a sample.
// PASS 0: the only pass; 1: draw large occluders, defer the rest; 2: also test against the depth of
// earlier passes. Bounds are conservative: culling never changes the image.
#version 450 core

layout(local_size_x = 64) in;

#include "culling/views.glsl"
#include "culling/bounds.glsl"
#include "culling/boxes.glsl"
#include "culling/screen_bounds.glsl"
#ifdef TRIANGLES
#include "culling/pairs.glsl"
#endif

const float CONE_TOLERANCE = 1e-5;

// Distances double every two bins.
const float NEAREST_M = 0.25;

void show(uint view, uint group, uint child, uint cluster, float far_m) {
    uint at = view / u_tiles * u_clusters + cluster, tile = view % u_tiles;
    bins[at] = uint(min(2.0 * log2(max(far_m / NEAREST_M, 1.0)), float(BINS - 1u)));
    // the result is the same in any order
    atomicOr(visible_tiles[at * tile_words() + tile / 32u], 1u << (tile & 31u));
    atomicOr(visible_of_group[view / u_tiles * u_groups + group], 1u << child);
#ifdef TRIANGLES
    pairs[listed_place(take_place(PAIRS + u_pass))] = pair_of(view, cluster);
#endif
}

void main() {
    uint index = gl_GlobalInvocationID.x;
    if (index >= lists[TESTED + u_pass].candidates) return;
    Candidate self = candidates[candidate_place(TESTED + u_pass, index)];
    uint left = 0u, view = self.view;
    Group group = group_at(self.group);
    Instance instance = instances[group.object * u_cameras * u_tiles + view];
    mat4 rows = transpose(instance.clip_from_object);
    vec3 viewpoint = instance.viewpoint.xyz;
    float margin = instance.viewpoint.w;
    vec4 rectangle_px = rectangles_px[view];
    for (uint children = self.clusters; children != 0u; children &= children - 1u) {
        uint child = uint(findLSB(children)), index = group.first_cluster + child;
        Cluster cluster = cluster_at(index);
        vec3 center = 0.5 * (cluster.aabb_min + cluster.aabb_max);
        vec3 extent = cluster.aabb_max - center;
        vec3 away = center - viewpoint;
        float distance_m = length(away), radius_m = length(extent);
        ClipBox box = clip_box(rows, center, extent, margin);
        bool faces_away = !u_both_sides && dot(cluster.cone_axis, away)
            > (cluster.cone_sine + CONE_TOLERANCE) * distance_m + radius_m;
        Bounds bounds = bounds_of(box, rectangle_px.zw);
        if (faces_away || !is_inside(box) || !covers_texel(bounds)) continue;
#if PASS == 2
        if (is_occluded(bounds, rectangle_px.xy, view / u_tiles)) continue;
#endif
#if PASS > 0
        if (cluster.width <= u_occluder_rad * max(distance_m - radius_m, 1e-3)) {
            left |= 1u << child;
            continue;
        }
#endif
        show(view, self.group, child, index, distance_m + radius_m);
    }
#if PASS > 0
    if (left != 0u) append(u_pass + 1u, Candidate(self.group, view, left));
#endif
}
