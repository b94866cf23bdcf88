// Culling of the triangles of shown clusters: those that face away, are outside of the tile, too
// small to cover a sample or, with PASS 2, behind the depth of earlier passes. The indices of those
// that are kept are copied one after the other, so that a cluster stays one draw command. One
// invocation per cluster and view. Corners are rounded to steps within the cluster's box, and
// bounds are conservative: culling never changes the image.
// Source: Wihlidal 2016, "Optimizing the graphics pipeline with compute".
#version 450 core

layout(local_size_x = 64) in;

#include "culling/views.glsl"
#include "culling/bounds.glsl"
#include "culling/boxes.glsl"
#include "culling/screen_bounds.glsl"
#include "culling/pairs.glsl"

layout(std430, binding = 1) buffer Indices { uint indices[]; };  // triangles, then the room

uniform usampler2D u_corners;  // see omnisim/rendering/opengl/culling/triangle_culling.py

const float STEPS = 16383.0;
const float ROUNDED = 1e-6;  // share of a triangle's size by which floats round its edges
const float ROUNDED_PX = 0.0625;  // by which a GPU rounds a corner at worst

struct View {
    mat4 rows;
    vec3 first;  // x, y and w of the corner where the steps begin
    vec3 steps[3];  // x, y and w of a step along each axis of the object
    vec3 error;  // largest error of x, y and w
    vec4 rectangle_px;
    float front;  // sign of the area of a triangle that faces away
    bool both_sides;
    uint camera;
};

bool is_left(View view, uvec4 words) {
    vec3 corners[3];
    for (int corner = 0; corner < 3; ++corner) {
        uint word = words[corner], low = words.w >> (10 * corner) & 1023u;
        vec3 at = vec3(word & 16383u, word >> 14 & 16383u, word >> 28 << 10 | low);
        corners[corner] = view.first + view.steps[0] * at.x + view.steps[1] * at.y
            + view.steps[2] * at.z;
    }
    float nearest_m = min(min(corners[0].z, corners[1].z), corners[2].z) - view.error.z;
    if (nearest_m < u_depths_m.x) return true;
    vec2 partpx = 0.5 * view.rectangle_px.zw, at_px[3];
    for (int corner = 0; corner < 3; ++corner)
        at_px[corner] = partpx * (corners[corner].xy / corners[corner].z + 1.0);
    vec2 low = min(min(at_px[0], at_px[1]), at_px[2]);
    vec2 high = max(max(at_px[0], at_px[1]), at_px[2]);
    vec2 one = at_px[1] - at_px[0], other = at_px[2] - at_px[0];
    // what is outside of the tile stays there
    vec2 error_px = 2.0 * partpx * (view.error.xy + view.error.z) / nearest_m;
    float off_px = 2.0 * (ROUNDED_PX + max(error_px.x, error_px.y));
    float area = view.front * (one.x * other.y - one.y * other.x);
    float tolerance = off_px * (dot(abs(one) + abs(other), vec2(1.0)) + off_px);
    if (!view.both_sides && area > tolerance) return false;
    vec2 reach_px = u_radius_px + error_px;
    Bounds bounds;
    bounds.crosses = false;
    bounds.nearest = u_depth.x + u_depth.y / nearest_m;
    bounds.first_px = clamp(ceil(low - 0.5 - reach_px), vec2(0.0), view.rectangle_px.zw);
    bounds.last_px = clamp(floor(high - 0.5 + reach_px), vec2(-1.0), view.rectangle_px.zw - 1.0);
    if (!covers_texel(bounds)) return false;
    // nor does it cover one if all of the covered texels' centers are beyond one of its edges
    vec2 first_px = bounds.first_px + 0.5, last_px = bounds.last_px + 0.5;
    vec2 middle_px = 0.5 * (first_px + last_px), half_px = 0.5 * (last_px - first_px) + reach_px;
    half_px += ROUNDED * (dot(abs(one) + abs(other), vec2(1.0)));
    float side = sign(area) * view.front;
    for (int corner = 0; corner < 3; ++corner) {
        vec2 edge = at_px[(corner + 1) % 3] - at_px[corner], off = middle_px - at_px[corner];
        float inside = side * (edge.x * off.y - edge.y * off.x);
        if (inside < -dot(abs(edge.yx), half_px)) return false;
    }
#if PASS == 2
    if (is_small_occluded(bounds, view.rectangle_px.xy, view.camera)) return false;
#endif
    return true;
}

void main() {
    uint at = gl_GlobalInvocationID.x;
    if (at >= lists[PAIRS + u_pass].candidates) return;
    uint pair = pairs[listed_place(at)], number = pair / u_clusters, own = pair % u_clusters;
    Cluster cluster = cluster_at(own);
    Instance instance = instances[cluster.object * u_cameras * u_tiles + number];
    vec3 step_m = (cluster.aabb_max - cluster.aabb_min) / STEPS;
    vec3 center = 0.5 * (cluster.aabb_min + cluster.aabb_max), extent = cluster.aabb_max - center;
    mat4 rows = transpose(instance.clip_from_object);
    mat4x3 seen = transpose(mat3x4(rows[0], rows[1], rows[3]));
    vec3 error = 0.5 * step_m
        + TOLERANCE * (instance.viewpoint.w + reach(center) + reach(extent));
    View view;
    view.first = seen * vec4(cluster.aabb_min, 1.0);
    view.steps = vec3[3](seen[0] * step_m.x, seen[1] * step_m.y, seen[2] * step_m.z);
    view.error = mat3(abs(seen[0]), abs(seen[1]), abs(seen[2])) * error;
    view.rectangle_px = rectangles_px[number];
    view.front = sign(determinant(mat3(seen)));
    view.both_sides = u_both_sides || cluster.cone_sine > BOTH_SIDES;
    view.camera = number / u_tiles;
    uvec2 range = index_ranges[own] / 3u;  // first triangle, and number
    uvec2 left = uvec2(0u);
    for (uint triangle = 0u; triangle < range.y; ++triangle) {
        uint place = range.x + triangle;
        uvec4 words = texelFetch(
            u_corners, ivec2(place & ((1u << ROW_BITS) - 1u), place >> ROW_BITS), 0);
        if (is_left(view, words)) left[triangle >> 5] |= 1u << (triangle & 31u);
    }
    uint count = uint(bitCount(left.x) + bitCount(left.y));
    if (count == 0u) {
        uint tile = number % u_tiles;
        uint word = (view.camera * u_clusters + own) * tile_words() + tile / 32u;
        atomicAnd(visible_tiles[word], ~(1u << (tile & 31u)));
        return;
    }
    uint first = range.x;
    if (count < range.y) {
        uint room = atomicAdd(lists[LISTS - 1u].candidates, count);
        if (room + count > u_room) {
            count = range.y;
        } else {
            first = u_room_first + room;
            uint kept = first;
            for (uint part = 0u; part < 2u; ++part) {
                for (uint bits = left[part]; bits != 0u; bits &= bits - 1u) {
                    uint from = 3u * (range.x + 32u * part + uint(findLSB(bits)));
                    for (uint corner = 0u; corner < 3u; ++corner)
                        indices[3u * kept + corner] = indices[from + corner];
                    ++kept;
                }
            }
        }
    }
    pairs[pair] = first << COUNT_BITS | count;
}
