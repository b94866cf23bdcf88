// Found look_up(vec3 place, vec3 here): what a ray hits, exactly; from where it looks in the atlas
// (`place.glsl`) and its unit direction here: in the world's axes, the origin is the viewpoint, metres.
//
// The atlas says which triangles are seen around the ray. Those, and what lies beside them where the
// ray just misses, are cut with the ray itself, and the nearest one counts: nothing is blended, no
// texel's edge is seen, and the distance is as exact as floats are.
//
// With ANY_HIT: bool is_hidden(vec3 place, vec3 here, uvec2 surface, float range): whether the ray hits
// anything before so much, other than that surface.

#include "ground_truth/tables.glsl"

const uint HOLED = 1u, DOUBLE_SIDED = 2u, MIRRORED = 4u;  // bits of a draw's kind
const uint NO_NEIGHBOUR = 0xFFFFFFFFu;
const uint MOST_STEPS = 3u;  // over edges, from a triangle that the ray misses
// What lies beside a triangle whose plane is farther than that behind a hit is not searched.
const float FARTHER = 1.1;

uniform usampler2D u_atlas;  // as visibility.frag writes it
uniform vec2 u_depth_limits_m;  // near and far plane of the faces

const float INFINITE = uintBitsToFloat(0x7F800000u);
// A ray between two triangles may miss both by rounding, a micrometre at 20 m: it hits the nearer.
const float EDGE_RAD = 2e-7;

#ifdef ALBEDO
// Squares of texels, more than there are around: what shows something else is as far away as that.
const float OTHER_TRIANGLE = 16.0, OTHER_DRAW = 32.0;
#endif

const int WIDTH = 3;  // of the block of texels around a ray's own
const uint PLACES = uint(WIDTH * WIDTH), OWN = PLACES / 2u;

ivec2 step_to(uint place) {
    return ivec2(int(place) % WIDTH, int(place) / WIDTH) - WIDTH / 2;
}

struct Triangle {
    vec3 a, b, c;  // corners, here
    vec3 normal;   // of its plane, towards the viewpoint, not of unit length
    bool turned;   // its corners run clockwise, seen from the viewpoint
    uvec3 beside;  // triangles beyond the edges opposite to the corners
};

struct Cut {
    float missed_rad;  // how far outside of the triangle the ray passes; negative: inside
    float range;       // to the triangle's plane
    vec3 weights;      // of the corners, not normalised
    uint beyond;       // the triangle behind the edge that it passes
};

struct Found {
    uvec2 surface;  // 1 + number of the draw, number of its triangle; 0: nothing is hit
    float range;    // infinite: nothing is hit
    vec3 weights;   // of the corners, not normalised
    vec3 normal;    // of the plane, towards the viewpoint, not of unit length
#ifdef ALBEDO
    // of the atlas, of those around the ray that show something: the nearest one that shows it, or
    // else one of its draw, or else any
    ivec2 texel;
#endif
};

Triangle triangle_of(uvec4 draw, vec4 viewpoint_from_mesh[3], uint number) {
    uint first = draw.x + 3u * number;
    uvec4 corners[3] = uvec4[3](corner_at(first), corner_at(first + 1u), corner_at(first + 2u));
    vec3 here[3];
    for (int corner = 0; corner < 3; ++corner) {
        vec4 mesh = vec4(uintBitsToFloat(corners[corner].xyz), 1.0);
        here[corner] = vec3(
            dot(viewpoint_from_mesh[0], mesh), dot(viewpoint_from_mesh[1], mesh), dot(viewpoint_from_mesh[2], mesh));
    }
    Triangle t;
    t.a = here[0];
    t.b = here[1];
    t.c = here[2];
    t.normal = cross(t.b - t.a, t.c - t.a);
    t.turned = dot(t.normal, t.a) > 0.0;
    t.normal *= t.turned ? -1.0 : 1.0;
    t.beside = uvec3(corners[0].w, corners[1].w, corners[2].w);
    return t;
}

// An edge and the viewpoint span a plane; the ray's sine to it tells the side that it passes on.
// Differences of corners, which are exact enough where the corners themselves are far away.
Cut cut(Triangle t, vec3 ray) {
    vec3 ab = cross(t.a, t.b - t.a), bc = cross(t.b, t.c - t.b), ca = cross(t.c, t.a - t.c);
    vec3 sides = vec3(dot(ray, bc), dot(ray, ca), dot(ray, ab));
    sides *= t.turned ? 1.0 : -1.0;  // a ray that hits passes all edges on this side
    vec3 missed = -sides * inversesqrt(max(vec3(dot(bc, bc), dot(ca, ca), dot(ab, ab)), 1e-30));
    Cut result;
    result.missed_rad = max(max(missed.x, missed.y), missed.z);
    result.range = dot(t.normal, t.a) / min(dot(t.normal, ray), -1e-30);
    result.weights = sides;
    result.beyond = missed.x >= max(missed.y, missed.z)
                        ? t.beside.x
                        : (missed.y >= missed.z ? t.beside.y : t.beside.z);
    return result;
}

#ifdef ANY_HIT
bool is_hidden(vec3 place, vec3 here, uvec2 surface, float range) {
#else
Found look_up(vec3 place, vec3 here) {
#endif
    ivec2 own_texel = ivec2(floor(place.xy));
    vec2 limits = u_depth_limits_m / place.z;  // along the ray
    Found hit, miss;  // the nearest that the ray hits; what it misses by least
    hit.surface = miss.surface = uvec2(0u);
    bool hits = false;
    hit.range = INFINITE;
#ifdef ANY_HIT
    hit.range = range;
#endif
    float least_rad = 1.0;
    // Which texels around show something that none before them shows, bit by bit. Its own comes
    // first, as what it hits spares the search behind it.
    uint around[PLACES];
    for (uint at = 0u; at < PLACES; ++at)
        around[at] = texelFetch(u_atlas, own_texel + step_to(at), 0).x;
    uint own = around[OWN];
    bool beside_nothing = false;
    uint candidates = own == 0u ? 0u : 1u;
    for (uint at = 0u; at < PLACES; ++at) {
        uint seen = around[at];
        beside_nothing = beside_nothing || seen == 0u;
        bool is_new = seen != 0u && seen != own;
        uint row = at / uint(WIDTH), column = at % uint(WIDTH);
        if (column > 0u) is_new = is_new && seen != around[at - 1u];
        if (row > 0u) is_new = is_new && seen != around[at - uint(WIDTH)];
        if (row > 0u && column < uint(WIDTH) - 1u)
            is_new = is_new && seen != around[at - uint(WIDTH) + 1u];
        if (is_new) candidates |= 2u << at;
    }
    uvec2 own_surface = surface_at(own);
#ifdef ANY_HIT
    if (own_surface == surface) {  // it hides nothing of itself
        candidates &= ~1u;
        hits = true;
    }
#endif
    uint hit_number = 0u, miss_number = 0u;  // 1 + theirs, where a texel shows them
    uvec2 beside = uvec2(0u);  // what is beyond the edge by which the last one was missed
    uint steps = 0u;
    while (candidates != 0u || beside.x != 0u) {
        uvec2 seen = beside;
        bool is_neighbour = beside.x != 0u;
        bool is_own = false;
        uint number = 0u;
        if (!is_neighbour) {
            is_own = (candidates & 1u) != 0u;
            uint at = is_own ? OWN : uint(findLSB(candidates)) - 1u;
            candidates &= candidates - 1u;
            number = texelFetch(u_atlas, own_texel + step_to(at), 0).x;
            seen = surface_at(number);
            if (seen == hit.surface) hit_number = number;
            steps = 0u;
        }
        beside = uvec2(0u);
        uvec4 draw = draw_at(seen.x - 1u);
        // what has holes shows where its own texel says so
        if ((draw.y & HOLED) != 0u && !is_own) continue;
        Triangle t = triangle_of(draw, matrix_at(seen.x - 1u, HERE_FROM_MESH), seen.y);
        bool is_back = t.turned != ((draw.y & MIRRORED) != 0u);
        if (is_neighbour && is_back && (draw.y & DOUBLE_SIDED) == 0u) continue;
        Cut found = cut(t, here);
        bool may_be_nearer = found.range < FARTHER * hit.range;
        if (found.missed_rad >= EDGE_RAD && steps < MOST_STEPS && may_be_nearer) {
            uvec2 next = uvec2(seen.x, found.beyond);
            // what was looked at before tells nothing new
            if (found.beyond != NO_NEIGHBOUR && next != own_surface && next != hit.surface) beside = next;
            ++steps;
        }
        if (found.range < limits.x || found.range > limits.y) continue;
        if (found.missed_rad < EDGE_RAD) {
            hits = true;
#ifdef ANY_HIT
            if (found.range < range && seen != surface) return true;
#endif
            if (found.range < hit.range) {
                hit.surface = seen;
                hit_number = number;
                hit.range = found.range;
                hit.weights = found.weights;
                hit.normal = t.normal;
            }
        } else if (found.missed_rad < least_rad) {
            least_rad = found.missed_rad;
            // the point of the triangle that is nearest to the ray, more or less
            vec3 weights = max(found.weights, vec3(0.0));
            weights /= max(weights.x + weights.y + weights.z, 1e-30);
            miss.surface = seen;
            miss_number = number;
            miss.range = length(weights.x * t.a + weights.y * t.b + weights.z * t.c);
            miss.weights = weights;
            miss.normal = t.normal;
        }
    }
    // A triangle too small to show in any texel: the one beside it that the ray misses by least.
    bool is_missed = !hits && !beside_nothing && miss.surface.x != 0u;
#ifdef ANY_HIT
    return is_missed && miss.range < range && miss.surface != surface;
#else
    if (is_missed) {
        hit = miss;
        hit_number = miss_number;
    }
#ifdef ALBEDO
    hit.texel = own_texel;
    float closest = INFINITE;
    for (uint at = 0u; at < PLACES; ++at) {
        if (around[at] == 0u) continue;  // nothing is shown there
        vec2 away = vec2(own_texel + step_to(at)) + 0.5 - place.xy;
        float distance = at == OWN ? 0.0 : dot(away, away);  // its own is the nearest
        // too small to show, or just beyond an edge: one of the same draw, or else any
        if (around[at] != hit_number)
            distance += surface_at(around[at]).x == hit.surface.x ? OTHER_TRIANGLE : OTHER_DRAW;
        if (distance < closest) {
            closest = distance;
            hit.texel = own_texel + step_to(at);
        }
    }
#endif
    return hit;
#endif
}
