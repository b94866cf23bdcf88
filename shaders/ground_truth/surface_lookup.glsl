// Found look_up(vec3 rig, vec3 here): what a ray hits, exactly; its unit direction in the rig frame
// and here. "Here" has the world's axes and its origin in the viewpoint, metres.
//
// The atlas says which triangles are seen around the ray. Those, and what lies beside them where the
// ray just misses, are cut with the ray itself, and the nearest one counts: nothing is blended, no
// texel's edge is seen, and the distance is as exact as floats are.

#include "capture/cube_faces.glsl"
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
    uvec2 surface;  // as in the atlas; 0: nothing is hit
    float range;    // infinite: nothing is hit
    vec3 weights;   // of the corners, not normalised
    vec3 normal;    // of the plane, towards the viewpoint, not of unit length
    vec2 place_px;  // where in the atlas the ray looks
    uvec2 own;      // what its own texel shows
};

Triangle triangle_of(uvec4 draw, vec4 here_from_mesh[3], uint number) {
    uint first = draw.x + 3u * number;
    uvec4 corners[3] = uvec4[3](corner_at(first), corner_at(first + 1u), corner_at(first + 2u));
    vec3 here[3];
    for (int corner = 0; corner < 3; ++corner) {
        vec4 mesh = vec4(uintBitsToFloat(corners[corner].xyz), 1.0);
        here[corner] = vec3(
            dot(here_from_mesh[0], mesh), dot(here_from_mesh[1], mesh), dot(here_from_mesh[2], mesh));
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

Found look_up(vec3 rig, vec3 here) {
    int face = face_of(rig);
    vec3 local = u_face_from_rig[face] * rig;
    int number = tile_of(face, local.xy / local.z);
    vec2 tangent = clamp(local.xy / local.z, u_tile_window[number].xy, u_tile_window[number].zw);
    vec4 tile = u_tile_place[number] * vec2(textureSize(u_atlas, 0)).xyxy;
    vec2 place_px = tile.xy + tangent * tile.zw;
    ivec2 own_texel = ivec2(floor(place_px));
    uvec2 own = texelFetch(u_atlas, own_texel, 0).xy;

    vec2 limits = u_depth_limits_m / local.z;  // along the ray
    bool beside_nothing = own.x == 0u;
    Found hit, miss;  // the nearest that the ray hits; what it misses by least
    hit.surface = miss.surface = uvec2(0u);
    hit.range = INFINITE;
    hit.place_px = miss.place_px = place_px;
    hit.own = miss.own = own;
    float least_rad = 1.0;
    // which texels around show something else than its own, bit by bit; its own comes first, as what
    // it hits spares the search behind it
    uint candidates = own.x == 0u ? 0u : 1u;
    uvec2 before = own;
    for (uint place = 0u; place < PLACES; ++place) {
        uvec2 seen = texelFetch(u_atlas, own_texel + step_to(place), 0).xy;
        beside_nothing = beside_nothing || seen.x == 0u;
        if (seen.x != 0u && seen != own && seen != before) candidates |= 2u << place;
        before = seen;
    }
    uvec2 beside = uvec2(0u);  // what is beyond the edge by which the last one was missed
    uint steps = 0u;
    while (candidates != 0u || beside.x != 0u) {
        uvec2 seen = beside;
        bool is_neighbour = beside.x != 0u;
        bool is_own = false;
        if (!is_neighbour) {
            is_own = (candidates & 1u) != 0u;
            uint place = is_own ? OWN : uint(findLSB(candidates)) - 1u;
            candidates &= candidates - 1u;
            seen = texelFetch(u_atlas, own_texel + step_to(place), 0).xy;
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
            if (found.beyond != NO_NEIGHBOUR) beside = uvec2(seen.x, found.beyond);
            ++steps;
        }
        if (found.range < limits.x || found.range > limits.y) continue;
        if (found.missed_rad < EDGE_RAD) {
            if (found.range < hit.range) {
                hit.surface = seen;
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
            miss.range = length(weights.x * t.a + weights.y * t.b + weights.z * t.c);
            miss.weights = weights;
            miss.normal = t.normal;
        }
    }
    // A triangle too small to show in any texel: the one beside it that the ray misses by least.
    bool is_missed = hit.surface.x == 0u && !beside_nothing && miss.surface.x != 0u;
    return is_missed ? miss : hit;
}
