// Settings of culling, which stay bound while the commands are drawn.
// The layout is that of omnisim/rendering/opengl/culling/cluster_culling.py.

layout(std140, binding = 0) uniform Settings {
    uint u_cameras;
    uint u_tiles;  // tiles per camera
    uint u_groups;
    uint u_objects;
    vec2 u_atlas_px;
    vec2 u_depths_m;    // depths of the near and far planes
    vec2 u_depth;       // a and b in depth = a + b / w, w along the view
    uint u_ranges;  // ranges of commands in all slices
    bool u_both_sides;  // back faces are visible too
    float u_radius_px;  // distance from a texel's center within which a box covers the texel
    uint u_clusters;
    uint u_pass;        // drawing pass; each omits clusters that earlier passes occlude
    float u_occluder_rad;  // clusters with wider triangles are drawn first, others are deferred
    uint u_first_range;  // first range of the slice whose commands are built
    uint u_blocks;
    uint u_room_first, u_room;  // first triangle, and number, of the room for kept triangles
};
