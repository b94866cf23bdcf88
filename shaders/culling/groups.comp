// Culling of cluster groups: those in the frustum of a view become candidates of the first pass.
#version 450 core

layout(local_size_x = 64) in;

#include "culling/views.glsl"
#include "culling/bounds.glsl"
#include "culling/boxes.glsl"
layout(std430, binding = 10) readonly buffer Shown { uint shown[]; };  // drawn clusters: [group]

void main() {
    uint index = gl_GlobalInvocationID.x, view = gl_GlobalInvocationID.y;
    if (index >= u_groups) return;
    Group group = group_at(index);
    uint clusters = shown[index];
    Instance instance = instances[group.object * u_cameras * u_tiles + view];
    vec3 center = 0.5 * (group.aabb_min + group.aabb_max), extent = group.aabb_max - center;
    mat4 rows = transpose(instance.clip_from_object);
    ClipBox box = clip_box(rows, center, extent, instance.viewpoint.w);
    if (clusters != 0u && is_inside(box)) append(0u, Candidate(index, view, clusters));
}
