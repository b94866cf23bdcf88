// Back-to-front draw commands of a camera's blended items, and back-to-front triangles of each
// item. One work group per item and camera. Ranks are found by counting, because items and
// triangles are few, see omnisim/rendering/opengl/surfaces/cluster_drawer.py.
#version 450 core

layout(local_size_x = 32) in;

#include "culling/views.glsl"

struct Item {
    vec3 center;  // center of the bounding sphere, object's frame
    float radius;
    uint first_triangle, triangles, object, unused;
};

struct Command {  // arguments of glMultiDrawElementsIndirect
    uint indices, instances, first_index, base_vertex, base_instance;
};

// Commands and counts of the culler; from u_first_command on [camera][rank][tile].
layout(std430, binding = 7) writeonly buffer Commands { Command commands[]; };
layout(std430, binding = 8) writeonly buffer Counts { uint counts[]; };
layout(std430, binding = 9) readonly buffer Items { Item items[]; };
layout(std430, binding = 10) readonly buffer Centers { vec4 centers[]; };       // triangle centers
layout(std430, binding = 11) readonly buffer Indices { uint indices[]; };
layout(std430, binding = 12) writeonly buffer Sorted { uint sorted_indices[]; };  // [camera]

uniform uint u_first_command, u_count_index;  // indices of the first command, and of their number
uniform uint u_items;
uniform uint u_triangles;  // triangles of all items

vec4[3] rows_of(uint object, uint camera) {
    return instances[(object * u_cameras + camera) * u_tiles].viewpoint_from_object;
}

// Precise: ranks compare distances of one point that two expressions compute.
float squared_distance(vec4 rows[3], vec3 point) {
    precise vec3 at = transformed(rows, point);
    precise float squared = dot(at, at);
    return squared;
}

// False if the sphere is completely outside the view.
bool may_be_seen(Item item, uint view) {
    Instance instance = instances[item.object * u_cameras * u_tiles + view];
    mat4 rows = transpose(instance.clip_from_object);
    vec4 planes[5] = vec4[5](
        rows[3] + rows[0], rows[3] - rows[0], rows[3] + rows[1], rows[3] - rows[1], rows[3]);
    for (int plane = 0; plane < 5; ++plane) {
        float inside = dot(planes[plane], vec4(item.center, 1.0));
        if (inside < -item.radius * length(planes[plane].xyz)) return false;
    }
    return true;
}

void main() {
    uint index = gl_WorkGroupID.x, camera = gl_WorkGroupID.y, thread = gl_LocalInvocationID.x;
    bool is_first = gl_GlobalInvocationID.xy == uvec2(0u);
    if (is_first) counts[u_count_index] = u_cameras * u_items * u_tiles;
    Item item = items[index];
    uint first = camera * u_triangles + item.first_triangle;
    vec4 rows[3] = rows_of(item.object, camera);  // once: compilers load buffers anew each time
    for (uint at = thread; at < item.triangles; at += 32u) {
        uint own = item.first_triangle + at, rank = 0u;
        float own_distance = squared_distance(rows, centers[own].xyz);
        for (uint other = 0u; other < item.triangles; ++other) {
            vec3 center = centers[item.first_triangle + other].xyz;
            float distance = squared_distance(rows, center);
            rank += uint(distance > own_distance || (distance == own_distance && other < at));
        }
        for (uint corner = 0u; corner < 3u; ++corner)
            sorted_indices[3u * (first + rank) + corner] = indices[3u * own + corner];
    }
    uint rank = 0u;
    float own_distance = squared_distance(rows, item.center);
    for (uint other = 0u; other < u_items; ++other) {
        vec4 others[3] = rows_of(items[other].object, camera);
        float distance = squared_distance(others, items[other].center);
        rank += uint(distance > own_distance || (distance == own_distance && other < index));
    }
    for (uint tile = thread; tile < u_tiles; tile += 32u) {
        uint view = camera * u_tiles + tile;
        commands[u_first_command + (camera * u_items + rank) * u_tiles + tile] = Command(
            may_be_seen(item, view) ? 3u * item.triangles : 0u, 1u, 3u * first, 0u,
            item.object * u_cameras * u_tiles + view);
    }
}
