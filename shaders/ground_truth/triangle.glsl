// Triangle triangle_of(uvec4 draw_item, vec4 viewpoint_from_mesh[3], uint index): triangle in the
//     viewpoint frame (world axes, meters), relative to the rays' origin.
// Crossing intersect_triangle(Triangle t, vec3 ray): intersection with a unit ray.
// vec3 weights_beside(Triangle t, uint edge, vec3 ray): corner weights of the point of an edge that
//     is nearest to the ray.
// Declare `vec3 ray_origin`, the rays' origin in the viewpoint frame, before this file.

#include "ground_truth/tables.glsl"

struct Triangle {
    vec3 a, b, c;       // corners
    vec3 normal;        // normal of its plane, toward the viewpoint, not of unit length
    bool is_clockwise;  // winding as seen from the viewpoint
    uvec3 adjacent;     // triangles beyond the edges opposite to the corners
};

struct Crossing {
    float outside_rad;  // angle by which the ray misses the triangle; negative: inside
    float range;        // distance along the ray to the triangle's plane
    vec3 weights;       // weights of the corners, not normalized
    uint edge;          // edge that the ray passes farthest outside: number of the opposite corner
    uint adjacent;      // triangle beyond that edge
};

Triangle triangle_of(uvec4 draw_item, vec4 viewpoint_from_mesh[3], uint index) {
    uint first = draw_item.x + 3u * index;
    uvec4 corners[3] = uvec4[3](corner_at(first), corner_at(first + 1u), corner_at(first + 2u));
    Triangle t;
    t.a = transformed(viewpoint_from_mesh, vec4(uintBitsToFloat(corners[0].xyz), 1.0));
    t.b = transformed(viewpoint_from_mesh, vec4(uintBitsToFloat(corners[1].xyz), 1.0));
    t.c = transformed(viewpoint_from_mesh, vec4(uintBitsToFloat(corners[2].xyz), 1.0));
    t.a -= ray_origin;
    t.b -= ray_origin;
    t.c -= ray_origin;
    t.normal = cross(t.b - t.a, t.c - t.a);
    t.is_clockwise = dot(t.normal, t.a) > 0.0;
    t.normal *= t.is_clockwise ? -1.0 : 1.0;
    t.adjacent = uvec3(corners[0].w, corners[1].w, corners[2].w);
    return t;
}

// An edge and the viewpoint span a plane; the sign of the ray's sine to this plane is the side on
// which the ray passes the edge. Differences of corners stay precise for distant triangles.
Crossing intersect_triangle(Triangle t, vec3 ray) {
    vec3 ab = cross(t.a, t.b - t.a), bc = cross(t.b, t.c - t.b), ca = cross(t.c, t.a - t.c);
    vec3 sides = vec3(dot(ray, bc), dot(ray, ca), dot(ray, ab));
    sides *= t.is_clockwise ? 1.0 : -1.0;  // a ray that hits passes all edges on this side
    vec3 outside = -sides * inversesqrt(max(vec3(dot(bc, bc), dot(ca, ca), dot(ab, ab)), 1e-30));
    Crossing crossing;
    crossing.outside_rad = max(max(outside.x, outside.y), outside.z);
    crossing.range = dot(t.normal, t.a) / min(dot(t.normal, ray), -1e-30);
    crossing.weights = sides;
    crossing.edge = outside.x >= max(outside.y, outside.z) ? 0u
        : outside.y >= outside.z ? 1u : 2u;
    crossing.adjacent = t.adjacent[crossing.edge];
    return crossing;
}

// The nearest point is where the edge crosses a plane, or an end of the edge. That plane contains
// the ray and the normal of the plane through the edge and the viewpoint.
vec3 weights_beside(Triangle t, uint edge, vec3 ray) {
    vec3 start = edge == 0u ? t.b : (edge == 1u ? t.c : t.a);
    vec3 along = (edge == 0u ? t.c : (edge == 1u ? t.a : t.b)) - start;
    vec3 plane = cross(start, along);
    float way = dot(cross(along, ray), plane);
    float share = way == 0.0 ? 0.5 : clamp(-dot(cross(start, ray), plane) / way, 0.0, 1.0);
    vec2 ends = vec2(1.0 - share, share);
    return edge == 0u ? vec3(0.0, ends)
        : edge == 1u ? vec3(ends.y, 0.0, ends.x) : vec3(ends, 0.0);
}
