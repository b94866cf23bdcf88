// Culling of cluster groups: the clusters of those that remain are tested next, unless all of them
// are so narrow that they are drawn in a later pass.
// PASS 0: the groups in the frustum of a view, one invocation per block of groups: in a large
// scene, most blocks are outside as a whole; 2: those that earlier passes left and do not occlude.
#version 450 core

layout(local_size_x = 64) in;

#include "culling/views.glsl"
#include "culling/bounds.glsl"
#include "culling/boxes.glsl"
#include "culling/screen_bounds.glsl"

void leave(Candidate self, Group group, vec3 viewpoint) {
    // cull.comp takes a cluster as near as its box's center less the box's radius. This radius
    // and the way between the centers are together at most sqrt(2) times the group's radius.
    float radius_m = sqrt(2.0) * 0.5 * length(group.aabb_max - group.aabb_min);
    float nearest_m = distance(0.5 * (group.aabb_min + group.aabb_max), viewpoint) - radius_m;
    bool is_later = group.width < 0.9999 * u_occluder_rad * nearest_m;
    append(is_later ? u_pass + 1u : TESTED + u_pass, self);
}

#if PASS == 0
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
            leave(Candidate(at, view, clusters), group, instance.viewpoint.xyz);
        }
    }
}
#else
void main() {
    uint index = gl_GlobalInvocationID.x;
    if (index >= lists[u_pass].candidates) return;
    Candidate self = candidates[candidate_place(u_pass, index)];
    Group group = group_at(self.group);
    Instance instance = instances[group.object * u_cameras * u_tiles + self.view];
    vec3 center = 0.5 * (group.aabb_min + group.aabb_max);
    ClipBox box = clip_box(
        transpose(instance.clip_from_object), center, group.aabb_max - center,
        instance.viewpoint.w);
    vec4 rectangle_px = rectangles_px[self.view];
    Bounds bounds = bounds_of(box, rectangle_px.zw);
    if (is_occluded(bounds, rectangle_px.xy, self.view / u_tiles)) return;
    leave(self, group, instance.viewpoint.xyz);
}
#endif
