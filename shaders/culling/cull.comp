// Culling of the clusters of a candidate (a group in a view) that are outside the frustum,
// back-facing, or too small to cover a sample.
// PASS 0: the only pass; 1: draw large occluders, defer the rest; 2: draw the deferred clusters
// that pass the depth test against earlier passes. Bounds are conservative: culling never changes
// the image.
#version 450 core

layout(local_size_x = 64) in;

#include "culling/views.glsl"
#include "culling/bounds.glsl"
#include "culling/boxes.glsl"
layout(std430, binding = 2) readonly buffer Rectangles { vec4 rectangles_px[]; };  // [view]

const float CONE_TOLERANCE = 1e-5;

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
#endif

// Distances double every two bins.
const float NEAREST_M = 0.25;

void show(uint view, uint group, uint child, uint cluster, float far_m) {
    uint at = view / u_tiles * u_clusters + cluster, tile = view % u_tiles;
    bins[at] = uint(min(2.0 * log2(max(far_m / NEAREST_M, 1.0)), float(BINS - 1u)));
    // the result is the same in any order
    atomicOr(visible_tiles[at * tile_words() + tile / 32u], 1u << (tile & 31u));
    atomicOr(visible_of_group[view / u_tiles * u_groups + group], 1u << child);
}

void main() {
    uint index = gl_GlobalInvocationID.x;
    if (index >= lists[u_pass].candidates) return;
    Candidate self = candidates[candidate_place(u_pass, index)];
    uint left = 0u, view = self.view;
    Group group = group_at(self.group);
    Instance instance = instances[group.object * u_cameras * u_tiles + view];
    mat4 rows = transpose(instance.clip_from_object);
    vec3 viewpoint = instance.viewpoint.xyz;
    float margin = instance.viewpoint.w;
    vec4 rectangle_px = rectangles_px[view];
    uint children = self.clusters;
#if PASS == 2
    vec3 middle = 0.5 * (group.aabb_min + group.aabb_max);
    Bounds around = bounds_of(
        clip_box(rows, middle, group.aabb_max - middle, margin), rectangle_px.zw);
    if (is_occluded(around, rectangle_px.xy, view / u_tiles)) children = 0u;
#endif
    for (; children != 0u; children &= children - 1u) {
        uint child = uint(findLSB(children)), index = group.first_cluster + child;
        Cluster cluster = cluster_at(index);
        vec3 center = 0.5 * (cluster.aabb_min + cluster.aabb_max);
        vec3 extent = cluster.aabb_max - center;
        vec3 away = center - viewpoint;
        float distance_m = length(away), radius_m = length(extent);
        ClipBox box = clip_box(rows, center, extent, margin);
#if PASS == 2
        if (is_occluded(bounds_of(box, rectangle_px.zw), rectangle_px.xy, view / u_tiles)) continue;
#else
        bool faces_away = !u_both_sides && dot(cluster.cone_axis, away)
            > (cluster.cone_sine + CONE_TOLERANCE) * distance_m + radius_m;
        if (faces_away || !is_inside(box)) continue;
        if (!covers_texel(bounds_of(box, rectangle_px.zw))) continue;
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
