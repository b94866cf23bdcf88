// Buffers shared by the culling shaders. A view is one tile of one camera, counted camera by
// camera. An object is a frame of rigid geometry: the static scene, then each dynamic object.
// vec3 transformed(vec4 rows[3], vec3 point): point in another frame.
// The layouts are those of omnisim/rendering/opengl/culling/.

#define MAX_PASSES 8u
// Lists of groups in views, one per possible pass, and one more; then of the shown pairs of each
// pass; then of the groups whose clusters are tested in it; and the number of kept triangles.
#define PAIRS (MAX_PASSES + 1u)
#define TESTED (2u * PAIRS)
#define LISTS (3u * PAIRS)

struct Instance {
    mat4 clip_from_object;         // clip space of the tile alone
    vec4 placement;                // scale and shift of the tile in the atlas's clip space
    vec4 viewpoint_from_object[3]; // rows of the transform
    vec4 viewpoint;                // viewpoint in the object's frame, and its L1 norm
};

layout(std430, binding = 3) buffer Instances { Instance instances[]; };  // [object][view]
// First index of a cluster, and its number of indices.
layout(std430, binding = 5) readonly buffer Ranges { uvec2 index_ranges[]; };
// Bits of the tiles where a cluster is visible: [camera][cluster][word].
layout(std430, binding = 6) buffer Visible { uint visible_tiles[]; };
// Bin of a visible cluster's distance, from near to far: [camera][cluster].
layout(std430, binding = 12) buffer Bins { uint bins[]; };

// Bits of a group's clusters that are visible in at least one tile: [camera][group].
layout(std430, binding = 13) buffer VisibleOfGroup { uint visible_of_group[]; };

#define BINS 32u
#define BANDS 2u     // bands of distance: all buckets are drawn band by band
#define FAR_BIN 10u  // first bin of the far band, which starts at 8 m

#include "culling/settings.glsl"

// Group of clusters in a view, to be tested in a pass.
struct Candidate {
    uint group;
    uint view;
    uint clusters;  // bits of the group's clusters
};

// The order of a list has no effect.
struct List {
    uint work_groups, work_groups_y, work_groups_z;  // dispatch of the shader that reads the list
    uint candidates;
};

layout(std430, binding = 4) buffer Lists {
    List lists[LISTS];
    Candidate candidates[];  // tested groups; those of passes with odd numbers; with even ones
};

// Number of words of a cluster's tile bits.
uint tile_words() {
    return (u_tiles + 31u) / 32u;
}

vec3 transformed(vec4 rows[3], vec3 point) {
    vec4 extended = vec4(point, 1.0);
    precise vec3 at =
        vec3(dot(rows[0], extended), dot(rows[1], extended), dot(rows[2], extended));
    return at;
}
