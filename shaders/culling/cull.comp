// Culls a group of clusters for one view, then its clusters: outside of the frustum, turned away, or
// too small to cover a sample. Bounds are conservative: what is drawn differs by nothing that shows.
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

bool covers_texel(ClipBox box, vec2 size_px) {
    vec2 low = vec2(1e30), high = vec2(-1e30);
    for (int corner = 0; corner < 8; ++corner) {
        vec3 signs = vec3(corner & 1, (corner >> 1) & 1, corner >> 2) * 2.0 - 1.0;
        float w = box.centre.z + dot(box.w_edges, signs);
        if (w < u_depths_m.x) return true;
        vec2 at = (box.centre.xy + vec2(dot(box.x_edges, signs), dot(box.y_edges, signs))) / w;
        low = min(low, at);
        high = max(high, at);
    }
    // a texel is covered where its centre is, half a texel after its edge
    vec2 first = ceil(0.5 * size_px * (low + 1.0) - (0.5 + u_radius_px));
    vec2 last = floor(0.5 * size_px * (high + 1.0) - (0.5 - u_radius_px));
    return all(lessThanEqual(max(first, vec2(0.0)), min(last, size_px - 1.0)));
}

void main() {
    uint group = gl_GlobalInvocationID.x, view = gl_GlobalInvocationID.y;
    if (group >= u_groups) return;
    Group self = groups[group];
    uint views = u_cameras * u_tiles;
    uint object = self.clusters_and_object >> 6u, children = self.clusters_and_object & 63u;
    Instance instance = instances[object * views + view];
    mat4 rows = transpose(instance.clip_from_object);
    vec3 viewpoint = viewpoint_of(instance.viewpoint_from_object);
    float margin = reach(viewpoint);

    uint visible = 0u;
    vec3 centre = 0.5 * (self.aabb_min + self.aabb_max), extent = self.aabb_max - centre;
    extent += TOLERANCE * (margin + reach(centre) + reach(extent));
    ClipBox box = ClipBox(
        vec3(dot(rows[0], vec4(centre, 1.0)), dot(rows[1], vec4(centre, 1.0)),
             dot(rows[3], vec4(centre, 1.0))),
        rows[0].xyz * extent, rows[1].xyz * extent, rows[3].xyz * extent);
    if (is_inside(box)) {
        uint candidates = shown[group];
        vec2 size_px = rectangles_px[view].zw;
        for (uint child = 0u; child < children; ++child) {
            Cluster cluster = clusters[self.first_cluster + child];
            centre = 0.5 * (cluster.aabb_min + cluster.aabb_max);
            extent = cluster.aabb_max - centre;
            vec3 away = centre - viewpoint;
            bool is_kept = u_both_sides || dot(cluster.cone_axis, away)
                <= (cluster.cone_sine + CONE_TOLERANCE) * length(away) + length(extent);
            extent += TOLERANCE * (margin + reach(centre) + reach(extent));
            box = ClipBox(
                vec3(dot(rows[0], vec4(centre, 1.0)), dot(rows[1], vec4(centre, 1.0)),
                     dot(rows[3], vec4(centre, 1.0))),
                rows[0].xyz * extent, rows[1].xyz * extent, rows[3].xyz * extent);
            if (is_kept && is_inside(box) && covers_texel(box, size_px)) visible |= 1u << child;
        }
        visible &= candidates;
    }
    uint camera = view / u_tiles;
    masks[(camera * u_groups + group) * u_tiles + view % u_tiles] = visible;
}
