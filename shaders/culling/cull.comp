// Culls a group of clusters for one view, then its clusters: outside of the frustum, turned away, or
// too small to cover a sample.
// PASS 0: the only one; 1: only what occludes others is drawn, the rest waits; 2: of what waits, but
// for what is behind the depth of the passes before, in the same way. Bounds are conservative: what is drawn differs by nothing that shows.
#version 430 core

layout(local_size_x = 64) in;

#include "culling/views.glsl"
layout(std430, binding = 2) readonly buffer Rectangles { vec4 rectangles_px[]; };  // [view]
layout(std430, binding = 10) readonly buffer Shown { uint shown[]; };  // clusters of each group

// Boxes are projected as floats: each counts as larger by this share of its distance.
const float TOLERANCE = 2e-6;
const float CONE_TOLERANCE = 1e-5;

float reach(vec3 edges) {
    return dot(abs(edges), vec3(1.0));
}

// Box in clip space; false: all of it is outside of one plane of the frustum.
struct ClipBox {
    vec3 centre;  // x, y, w
    vec3 x_edges, y_edges, w_edges;
};

bool is_inside(ClipBox box) {
    float depth = reach(box.w_edges), x = box.centre.x, y = box.centre.y, w = box.centre.z;
    return w + depth >= u_depths_m.x && w - depth <= u_depths_m.y
        && w + x + reach(box.w_edges + box.x_edges) >= 0.0
        && w - x + reach(box.w_edges - box.x_edges) >= 0.0
        && w + y + reach(box.w_edges + box.y_edges) >= 0.0
        && w - y + reach(box.w_edges - box.y_edges) >= 0.0;
}

// Bounds of a box on the screen.
struct Bounds {
    bool crosses;  // the near plane: they are the whole tile
    float nearest; // depth
    vec2 first_px, last_px;  // texels of the tile whose centres it covers
};

Bounds bounds_of(ClipBox box, vec2 size_px) {
    vec2 low = vec2(1e30), high = vec2(-1e30);
    float nearest_m = 1e30;
    for (int corner = 0; corner < 8; ++corner) {
        vec3 signs = vec3(corner & 1, (corner >> 1) & 1, corner >> 2) * 2.0 - 1.0;
        float w = box.centre.z + dot(box.w_edges, signs);
        nearest_m = min(nearest_m, w);
        vec2 at = vec2(dot(box.x_edges, signs), dot(box.y_edges, signs));
        at = (box.centre.xy + at) / max(w, u_depths_m.x);
        low = min(low, at);
        high = max(high, at);
    }
    // a texel is covered where its centre is, half a texel after its edge
    Bounds bounds;
    bounds.crosses = nearest_m < u_depths_m.x;
    bounds.nearest = u_depth.x + u_depth.y / nearest_m;
    bounds.first_px = max(ceil(0.5 * size_px * (low + 1.0) - (0.5 + u_radius_px)), vec2(0.0));
    bounds.last_px =
        min(floor(0.5 * size_px * (high + 1.0) - (0.5 - u_radius_px)), size_px - 1.0);
    return bounds;
}

bool covers_texel(Bounds bounds) {
    return bounds.crosses || all(lessThanEqual(bounds.first_px, bounds.last_px));
}

#if PASS == 2
#include "culling/hi_z.glsl"
layout(std430, binding = 12) readonly buffer HiZ { float farthest[]; };

const float DEPTH_TOLERANCE = 1e-4;  // of a depth: what is this close behind a surface is drawn
const int MAX_CELLS = 4;             // to a side

// All that it covers is nearer than all of the box.
bool is_occluded(Bounds bounds, vec2 corner_px, uint camera) {
    if (bounds.crosses) return false;
    ivec2 first_px = ivec2(corner_px + bounds.first_px);
    ivec2 last_px = ivec2(corner_px + bounds.last_px);
    uvec2 groups = (uvec2(u_atlas_px) + uint(CELL_PX * SIDE - 1)) / uint(CELL_PX * SIDE);
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

#if PASS > 0
// Bits of a group's clusters that wait for a later pass: [camera][group][tile].
layout(std430, binding = 11) buffer Waiting { uint waiting[]; };
#endif

ClipBox clip_box(mat4 rows, vec3 centre, vec3 extent) {
    vec4 at = vec4(centre, 1.0);
    return ClipBox(
        vec3(dot(rows[0], at), dot(rows[1], at), dot(rows[3], at)),
        rows[0].xyz * extent, rows[1].xyz * extent, rows[3].xyz * extent);
}

// Distances double every two bins.
const float NEAREST_M = 0.25;

void show(uint view, uint group, uint child, float far_m) {
    uint cluster = groups[group].first_cluster + child;
    uint at = view / u_tiles * u_clusters + cluster, tile = view % u_tiles;
    bins[at] = uint(clamp(2.0 * log2(far_m / NEAREST_M), 0.0, float(BINS - 1u)));
    // the outcome is the same in any order
    atomicOr(visible_tiles[at * tile_words() + tile / 32u], 1u << (tile & 31u));
    atomicOr(visible_of_group[view / u_tiles * u_groups + group], 1u << child);
}

void main() {
    uint group = gl_GlobalInvocationID.x, view = gl_GlobalInvocationID.y;
    if (group >= u_groups) return;
    uint place = (view / u_tiles * u_groups + group) * u_tiles + view % u_tiles;
    Group self = groups[group];
    uint object = self.clusters_and_object >> 6u;
#if PASS == 2
    uint candidates = waiting[place];
#else
    uint candidates = shown[group];
#endif
    uint left = 0u;
    if (candidates != 0u) {
        Instance instance = instances[object * u_cameras * u_tiles + view];
        mat4 rows = transpose(instance.clip_from_object);
        vec3 viewpoint = viewpoint_of(instance.viewpoint_from_object);
        float margin = reach(viewpoint);
        vec4 rectangle_px = rectangles_px[view];
        vec3 centre = 0.5 * (self.aabb_min + self.aabb_max), extent = self.aabb_max - centre;
        extent += TOLERANCE * (margin + reach(centre) + reach(extent));
        ClipBox box = clip_box(rows, centre, extent);
#if PASS == 2
        bool is_kept = !is_occluded(bounds_of(box, rectangle_px.zw), rectangle_px.xy, view / u_tiles);
#else
        bool is_kept = is_inside(box);
#endif
        if (!is_kept) candidates = 0u;
        for (; candidates != 0u; candidates &= candidates - 1u) {
            uint child = uint(findLSB(candidates));
            Cluster cluster = clusters[self.first_cluster + child];
            centre = 0.5 * (cluster.aabb_min + cluster.aabb_max);
            extent = cluster.aabb_max - centre;
            vec3 away = centre - viewpoint;
            float distance_m = length(away), radius_m = length(extent);
            extent += TOLERANCE * (margin + reach(centre) + reach(extent));
            box = clip_box(rows, centre, extent);
#if PASS == 2
            if (is_occluded(bounds_of(box, rectangle_px.zw), rectangle_px.xy, view / u_tiles))
                continue;
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
            show(view, group, child, distance_m + radius_m);
        }
    }
#if PASS > 0
    waiting[place] = left;
#endif
}
