// Settings of culling. They stay bound while its commands are drawn.
// The layout is that of omnisim/rendering/opengl/culling/cluster_culling.py.

layout(std140, binding = 0) uniform Settings {
    uint u_cameras;
    uint u_tiles;  // of a camera
    uint u_groups;
    uint u_objects;
    vec2 u_atlas_px;
    vec2 u_depths_m;    // of the near and far plane
    vec2 u_depth;       // a and b in a + b / w, w along the view
    uint u_ranges;  // of commands, of all slices
    bool u_both_sides;  // back faces are visible too
    float u_radius_px;  // distance from a texel's center up to which it is covered
    uint u_clusters;
    uint u_pass;        // of the drawing passes: each omits what earlier passes occlude
    float u_occluder_rad;  // clusters with wider triangles are drawn, the rest is deferred
    uint u_first_range;  // of the slice of clusters whose commands are built
};
