// Triangle triangle_of(uvec4 draw_item, vec4 viewpoint_from_mesh[3], uint index): a triangle in the
// viewpoint frame: the world's axes, the origin is the viewpoint, metres.
// Crossing intersect_triangle(Triangle t, vec3 ray): that with a unit ray from the viewpoint.

#include "ground_truth/tables.glsl"

struct Triangle {
    vec3 a, b, c;       // corners
    vec3 normal;        // of its plane, towards the viewpoint, not of unit length
    bool is_clockwise;  // seen from the viewpoint
    uvec3 adjacent;     // triangles beyond the edges opposite to the corners
};

struct Crossing {
    float outside_rad;  // by how much the ray passes outside of the triangle; negative: inside
    float range;        // to the triangle's plane
    vec3 weights;       // of the corners, not normalised
    uint adjacent;      // triangle beyond the edge that the ray passes
};

Triangle triangle_of(uvec4 draw_item, vec4 viewpoint_from_mesh[3], uint index) {
    uint first = draw_item.x + 3u * index;
    uvec4 corners[3] = uvec4[3](corner_at(first), corner_at(first + 1u), corner_at(first + 2u));
    Triangle t;
    t.a = transformed(viewpoint_from_mesh, vec4(uintBitsToFloat(corners[0].xyz), 1.0));
    t.b = transformed(viewpoint_from_mesh, vec4(uintBitsToFloat(corners[1].xyz), 1.0));
    t.c = transformed(viewpoint_from_mesh, vec4(uintBitsToFloat(corners[2].xyz), 1.0));
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
    crossing.adjacent = outside.x >= max(outside.y, outside.z)
                            ? t.adjacent.x
                            : (outside.y >= outside.z ? t.adjacent.y : t.adjacent.z);
    return crossing;
}
