// Hit intersect(vec3 texel, vec3 ray): nearest triangle that a ray from the viewpoint hits.
// bool occluded(vec3 texel, vec3 ray, uvec2 ignored, float max_range): true if any triangle except
//     the ignored primitive is nearer than max_range.
// texel: atlas position as in `texel.glsl`; ray: unit direction in the viewpoint frame.
//
// Candidates are the triangles that the atlas shows around the ray, and their neighbors where the
// ray just misses. They are intersected with the ray itself; the nearest hit counts. So nothing is
// blended, no texel edges appear, and ranges have float precision. With SLICE, triangles are
// interpolated at `slice_share` between a draw item's two matrices.

#include "ground_truth/texel_block.glsl"
#include "ground_truth/triangle.glsl"

const uint NO_TRIANGLE = 0xFFFFFFFFu;
// Steps to adjacent triangles after a miss.
const uint FEW_STEPS = 3u;
// Those of a second search, if the ray hits nothing: between a texel's triangle and the ray's may
// lie many that are too narrow for any texel. With GUESS there is none: the texel may be the wrong
// one, and such a ray remains undecided.
#ifdef GUESS
const uint MANY_STEPS = FEW_STEPS;
#else
const uint MANY_STEPS = 64u;
#endif
// The search does not continue from a triangle whose plane is farther than this times the hit.
const float FARTHER = 1.1;
#define INFINITE uintBitsToFloat(0x7F800000u)  // some compilers lack it as a constant
// By rounding, a ray may miss both triangles at an edge, by a micrometer at 20 m; it hits the
// nearer.
const float EDGE_RAD = 2e-7;

uniform vec2 u_depth_limits_m;  // near and far planes of the faces

struct Hit {
    uvec2 primitive;   // 1 + draw item, and triangle in it; 0: no hit
    uint triangle_id;  // ID of the triangle if a texel shows it, else 0
    bool beside;       // the ray just misses this triangle, and hits no other
    float range;       // infinite: no hit
    vec3 weights;      // weights of the corners, not normalized
    vec3 normal;       // normal of the plane, toward the viewpoint, not of unit length
};

// any_hit (a constant): return the first hit nearer than max_range, except the ignored primitive.
Hit trace(vec3 texel, vec3 ray, uvec2 ignored, float max_range, bool any_hit) {
    ivec2 own_texel = ivec2(floor(texel.xy));
    vec2 limits = u_depth_limits_m / texel.z;  // ranges along the ray
    Hit hit, miss;  // nearest hit; triangle that the ray misses by least
    hit.primitive = miss.primitive = uvec2(0u);
    hit.triangle_id = miss.triangle_id = 0u;
    hit.range = max_range;
    hit.beside = miss.beside = false;
    hit.weights = hit.normal = miss.weights = miss.normal = vec3(0.0);
    miss.range = max_range;
    bool hits = false;
    float least_rad = 1.0;
    uint ids[TEXELS] = ids_around(own_texel);
    uint distinct = distinct_texels(ids), candidates = distinct;
    bool shows_nothing = false;
    for (uint at = 0u; at < TEXELS; ++at) shows_nothing = shows_nothing || ids[at] == 0u;
    uvec2 own_primitive = primitive_at(ids[OWN]);
    if (any_hit && own_primitive == ignored) {  // a triangle does not occlude itself
        candidates &= ~1u;
        hits = true;
    }
    uvec2 adjacent = uvec2(0u);  // triangle beyond the edge that the ray passed last
    uvec2 previous = uvec2(0u);  // triangle before that edge
    uint steps = 0u, max_steps = FEW_STEPS;
    while (true) {
        if (candidates == 0u && adjacent.x == 0u) {
            if (hits || shows_nothing || max_steps == MANY_STEPS) break;
            max_steps = MANY_STEPS;
            candidates = distinct;
        }
        uvec2 primitive = adjacent;
        bool is_adjacent = adjacent.x != 0u;
        bool is_own = false;
        uint triangle_id = 0u;
        if (!is_adjacent) {
            is_own = (candidates & 1u) != 0u;
            uint at = is_own ? OWN : uint(findLSB(candidates)) - 1u;
            candidates &= candidates - 1u;
            triangle_id = id_at(own_texel + texel_offset(at));
            primitive = primitive_at(triangle_id);
            if (primitive == hit.primitive) hit.triangle_id = triangle_id;
            previous = uvec2(0u);
            steps = 0u;
        }
        adjacent = uvec2(0u);
        uvec4 draw_item = draw_item_at(primitive.x - 1u);
        // a masked triangle has holes: only the ray's own texel can show a hit
        if ((draw_item.y & MASKED) != 0u && !is_own) continue;
        vec4 viewpoint_from_mesh[3] = matrix_at(primitive.x - 1u, VIEWPOINT_FROM_MESH);
#ifdef SLICE
        vec4 at_end[3] = matrix_at(primitive.x - 1u, SECOND_MATRIX);
        for (int row = 0; row < 3; ++row)
            viewpoint_from_mesh[row] = mix(viewpoint_from_mesh[row], at_end[row], slice_share);
#endif
        Triangle t = triangle_of(draw_item, viewpoint_from_mesh, primitive.y);
        bool is_back = t.is_clockwise != ((draw_item.y & FLIPS_WINDING) != 0u);
        if (is_adjacent && is_back && (draw_item.y & DOUBLE_SIDED) == 0u) continue;
        Crossing crossing = intersect_triangle(t, ray);
        bool may_be_nearer = crossing.range < FARTHER * hit.range;
        if (crossing.outside_rad >= EDGE_RAD && steps < max_steps && may_be_nearer) {
            uvec2 next = uvec2(primitive.x, crossing.adjacent);
            // skip triangles that have been intersected already
            if (crossing.adjacent != NO_TRIANGLE && next != own_primitive && next != hit.primitive
                    && next != previous)
                adjacent = next;
            previous = primitive;
            ++steps;
        }
        if (crossing.range < limits.x || crossing.range > limits.y) continue;
        if (crossing.outside_rad < EDGE_RAD) {
            hits = true;
            bool is_nearer = crossing.range < hit.range;
            bool ends = any_hit && crossing.range < max_range && primitive != ignored;
            if (is_nearer || ends) {
                hit = Hit(
                    primitive, triangle_id, false, crossing.range, crossing.weights, t.normal);
                if (ends) return hit;
            }
        } else if (crossing.outside_rad < least_rad) {
            least_rad = crossing.outside_rad;
            vec3 weights = weights_beside(t, crossing.edge, ray);
            float range = length(weights.x * t.a + weights.y * t.b + weights.z * t.c);
            miss = Hit(primitive, triangle_id, true, range, weights, t.normal);
        }
    }
    // The hit triangle is too small for any texel: take the one that the ray misses by least.
    if (!hits && !shows_nothing && miss.primitive.x != 0u) hit = miss;
    return hit;
}

Hit intersect(vec3 texel, vec3 ray) {
    return trace(texel, ray, uvec2(0u), INFINITE, false);
}

bool occluded(vec3 texel, vec3 ray, uvec2 ignored, float max_range) {
    Hit hit = trace(texel, ray, ignored, max_range, true);
    return hit.primitive.x != 0u && hit.primitive != ignored && hit.range < max_range;
}
