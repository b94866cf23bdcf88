// Triangle triangle_of(uvec4 draw_item, vec4 viewpoint_from_mesh[3], uint index): a triangle in the
// viewpoint frame: the world's axes, the origin is the viewpoint, meters.
// Crossing intersect_triangle(Triangle t, vec3 ray): intersection with a unit ray.
// vec3 weights_beside(Triangle t, uint edge, vec3 ray): weights of an edge's nearest point.
// A program declares `ray_origin`, from the viewpoint, before: rays start there.

#include "ground_truth/tables.glsl"

struct Triangle {
    vec3 a, b, c;       // corners
    vec3 normal;        // of its plane, toward the viewpoint, not of unit length
    bool is_clockwise;  // seen from the viewpoint
    uvec3 adjacent;     // triangles beyond the edges opposite to the corners
};

struct Crossing {
    float outside_rad;  // angle by which the ray misses the triangle; negative: inside
    float range;        // to the triangle's plane
    vec3 weights;       // of the corners, not normalized
    uint edge;          // edge that the ray passes by most: number of the opposite corner
    uint adjacent;      // triangle beyond it
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

// An edge and the viewpoint span a plane; the ray's sine to it tells the side that it passes on.
// Differences of corners, which are exact enough where the corners themselves are far away.
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

// The point of the passed edge that is nearest to the ray: in the plane of the ray and the normal
// of the plane that the edge and the viewpoint span, or an end.
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
