// Matrices of each object in each view, from the poses of cameras and objects. Also resets commands
// and candidates.
#version 450 core

layout(local_size_x = 64) in;

#include "culling/views.glsl"
// Rows of rig_from_viewpoint, then of viewpoint_from_object of each object: [camera].
layout(std430, binding = 0) readonly buffer Poses { vec4 poses[]; };
layout(std430, binding = 1) readonly buffer Tiles { mat4 clip_from_rig[]; };
layout(std430, binding = 2) readonly buffer Rectangles { vec4 rectangles_px[]; };  // [view]

layout(std430, binding = 8) buffer Counts { uint counts[]; };  // commands: [pass][band][range]

void main() {
    uint at = gl_GlobalInvocationID.x, views = u_cameras * u_tiles;
    if (at < MAX_PASSES * BANDS * u_ranges) counts[at] = 0u;
    if (at < LISTS) lists[at] = List(0u, 1u, 1u, 0u);
    if (at >= views * u_objects) return;
    uint view = at % views, object = at / views;
    uint first = 3u * (1u + u_objects) * (view / u_tiles);
    mat4 rig_from_viewpoint = transpose(
        mat4(poses[first], poses[first + 1u], poses[first + 2u], vec4(0.0, 0.0, 0.0, 1.0)));
    first += 3u * (1u + object);
    vec4 rows[3] = vec4[3](poses[first], poses[first + 1u], poses[first + 2u]);
    mat4 viewpoint_from_object =
        transpose(mat4(rows[0], rows[1], rows[2], vec4(0.0, 0.0, 0.0, 1.0)));
    instances[at].clip_from_object =
        clip_from_rig[view % u_tiles] * rig_from_viewpoint * viewpoint_from_object;
    vec4 rectangle = rectangles_px[view];
    vec2 scale = rectangle.zw / u_atlas_px;
    instances[at].placement = vec4(scale, 2.0 * rectangle.xy / u_atlas_px + scale - 1.0);
    instances[at].viewpoint_from_object = rows;
    // the pose is rigid
    vec3 viewpoint =
        -(rows[0].xyz * rows[0].w + rows[1].xyz * rows[1].w + rows[2].xyz * rows[2].w);
    instances[at].viewpoint = vec4(viewpoint, dot(abs(viewpoint), vec3(1.0)));
}
