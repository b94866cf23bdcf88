// Culling of cluster groups: those in the frustum of a view become candidates of the first pass.
// One invocation per block of groups: in a large scene, most blocks are outside as a whole.
#version 450 core

layout(local_size_x = 64) in;

#include "culling/views.glsl"
#include "culling/bounds.glsl"
#include "culling/boxes.glsl"
layout(std430, binding = 10) readonly buffer Shown { uint shown[]; };  // drawn clusters: [group]

bool is_in_view(mat4 rows, float margin, vec3 aabb_min, vec3 aabb_max) {
    vec3 center = 0.5 * (aabb_min + aabb_max);
    return is_inside(clip_box(rows, center, aabb_max - center, margin));
}

void main() {
    uint index = gl_GlobalInvocationID.x, view = gl_GlobalInvocationID.y;
    if (index >= u_blocks) return;
    Block block = block_at(index);
    uint object = group_at(block.first_group).object;
    Instance instance = instances[object * u_cameras * u_tiles + view];
    mat4 rows = transpose(instance.clip_from_object);
    float margin = instance.viewpoint.w;
    if (!is_in_view(rows, margin, block.aabb_min, block.aabb_max)) return;
    for (uint at = block.first_group; at < block.first_group + block.groups; ++at) {
        Group group = group_at(at);
        uint clusters = shown[at];
        if (clusters != 0u && is_in_view(rows, margin, group.aabb_min, group.aabb_max)) {
            append(0u, Candidate(at, view, clusters));
        }
    }
}
