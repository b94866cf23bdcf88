// void emit(bool valid, vec3 ray): what the ray of a pixel hits, exactly; the ray in the optical
// frame, of any length.
//
// The atlas says which triangles are seen around the ray. Those, and what lies beside them where the
// ray just misses, are cut with the ray itself, and the nearest one counts: nothing is blended, no
// texel's edge is seen, and the distance is as exact as floats are. "Here" has the world's axes and its origin in the viewpoint, metres.

#include "capture/cube_faces.glsl"
#include "scene/vertex_words.glsl"

struct DrawRecord {
    vec4 here_from_mesh[3];    // rows
    vec4 normal_from_mesh[3];  // rows of the cofactors, see scene_buffers.py
    uvec4 first_kind;          // first index, bits of the constants below, unused
};
layout(std430, binding = 2) readonly buffer Draws { DrawRecord draws[]; };
layout(std430, binding = 3) readonly buffer Neighbours { uint neighbours[]; };

const uint HOLED = 1u, DOUBLE_SIDED = 2u, MIRRORED = 4u;
const uint NO_NEIGHBOUR = 0xFFFFFFFFu;
const uint MOST_STEPS = 3u;  // over edges, from a triangle that the ray misses
// What lies beside a triangle whose plane is farther than that behind a hit is not searched.
const float FARTHER = 1.1;

uniform usampler2D u_atlas;  // as visibility.frag writes it
uniform mat3 u_here_from_optical;
uniform vec2 u_depth_limits_m;  // near and far plane of the faces

layout(location = 0) out vec4 out_hit;       // here; range, infinite: nothing is hit, but in that direction
layout(location = 1) out uvec2 out_surface;  // as in the atlas; 0, 1: a ray that hits nothing
#ifdef NORMALS
layout(location = 2) out vec4 out_normal;  // here, unit
#endif
#ifdef ALBEDO
uniform sampler2D u_albedos;
layout(location = 3) out vec4 out_albedo;
#endif

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
};

struct Cut {
    float missed_rad;  // how far outside of the triangle the ray passes; negative: inside
    float range;       // to the triangle's plane
    vec3 weights;      // of the corners, not normalised
    uint beyond;       // the corner opposite to the edge that it passes
};

struct Found {
    uvec2 surface;
    float range;
    vec3 weights;  // of the corners, not normalised
    vec3 normal;   // of the plane, towards the viewpoint, not of unit length
};

vec3 here_at(uint number, uint index) {
    vec4 mesh = vec4(position_at(vertex_at(index)), 1.0);
    return vec3(
        dot(draws[number].here_from_mesh[0], mesh),
        dot(draws[number].here_from_mesh[1], mesh),
        dot(draws[number].here_from_mesh[2], mesh));
}

Triangle triangle_of(uvec2 surface) {
    uint number = surface.x - 1u, first = draws[number].first_kind.x + 3u * surface.y;
    Triangle t;
    t.a = here_at(number, first);
    t.b = here_at(number, first + 1u);
    t.c = here_at(number, first + 2u);
    t.normal = cross(t.b - t.a, t.c - t.a);
    t.turned = dot(t.normal, t.a) > 0.0;
    t.normal *= t.turned ? -1.0 : 1.0;
    return t;
}

#ifdef NORMALS
// As scene/surface.frag has it: the interpolated normal, or the plane's, of the side that is seen.
vec3 normal_of(Found hit) {
    uint number = hit.surface.x - 1u;
    uint first = draws[number].first_kind.x + 3u * hit.surface.y;
    // of any length: the weights need not be normalised
    vec3 mesh = hit.weights.x * normal_at(vertex_at(first)) +
                hit.weights.y * normal_at(vertex_at(first + 1u)) +
                hit.weights.z * normal_at(vertex_at(first + 2u));
    vec3 smooth_normal = vec3(
        dot(draws[number].normal_from_mesh[0].xyz, mesh),
        dot(draws[number].normal_from_mesh[1].xyz, mesh),
        dot(draws[number].normal_from_mesh[2].xyz, mesh));
    vec3 normal = dot(smooth_normal, smooth_normal) > 0.0 ? smooth_normal : hit.normal;
    return normalize(normal * (dot(normal, hit.normal) < 0.0 ? -1.0 : 1.0));
}
#endif

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
    result.beyond = missed.x >= max(missed.y, missed.z) ? 0u : (missed.y >= missed.z ? 1u : 2u);
    return result;
}

void emit(bool valid, vec3 ray) {
    out_hit = vec4(u_here_from_optical * normalize(ray), INFINITE);
    out_surface = uvec2(0u, valid ? 1u : 0u);
#ifdef NORMALS
    out_normal = vec4(0.0);
#endif
#ifdef ALBEDO
    out_albedo = vec4(0.0);
#endif
    if (!valid) return;

    ray = normalize(ray);
    vec3 rig = u_rig_from_optical * ray;
    int face = face_of(rig);
    vec3 local = u_face_from_rig[face] * rig;
    int number = tile_of(face, local.xy / local.z);
    vec2 tangent = clamp(local.xy / local.z, u_tile_window[number].xy, u_tile_window[number].zw);
    vec4 tile = u_tile_place[number] * vec2(textureSize(u_atlas, 0)).xyxy;
    ivec2 own_texel = ivec2(floor(tile.xy + tangent * tile.zw));
    uvec2 own = texelFetch(u_atlas, own_texel, 0).xy;

    vec3 here = u_here_from_optical * ray;
    vec2 limits = u_depth_limits_m / local.z;  // along the ray
    bool beside_nothing = own.x == 0u;
    Found hit, miss;  // the nearest that the ray hits; what it misses by least
    hit.surface = miss.surface = uvec2(0u);
    hit.range = INFINITE;
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
        uvec2 first_kind = draws[seen.x - 1u].first_kind.xy;
        // what has holes shows where its own texel says so
        if ((first_kind.y & HOLED) != 0u && !is_own) continue;
        Triangle t = triangle_of(seen);
        bool is_back = t.turned != ((first_kind.y & MIRRORED) != 0u);
        if (is_neighbour && is_back && (first_kind.y & DOUBLE_SIDED) == 0u) continue;
        Cut found = cut(t, here);
        bool may_be_nearer = found.range < FARTHER * hit.range;
        if (found.missed_rad >= EDGE_RAD && steps < MOST_STEPS && may_be_nearer) {
            uint next = neighbours[first_kind.x + 3u * seen.y + found.beyond];
            if (next != NO_NEIGHBOUR) beside = uvec2(seen.x, next);
            ++steps;
        }
        if (found.range < limits.x || found.range > limits.y) continue;
        if (found.missed_rad < EDGE_RAD) {
            if (found.range < hit.range) hit = Found(seen, found.range, found.weights, t.normal);
        } else if (found.missed_rad < least_rad) {
            least_rad = found.missed_rad;
            // the point of the triangle that is nearest to the ray, more or less
            vec3 weights = max(found.weights, vec3(0.0));
            weights /= max(weights.x + weights.y + weights.z, 1e-30);
            float range = length(weights.x * t.a + weights.y * t.b + weights.z * t.c);
            miss = Found(seen, range, weights, t.normal);
        }
    }
    // A triangle too small to show in any texel: the one beside it that the ray misses by least.
    if (hit.surface.x == 0u) {
        if (beside_nothing || miss.surface.x == 0u) return;
        hit = miss;
    }
    out_hit = vec4(hit.range * here, hit.range);
    out_surface = hit.surface;
#ifdef NORMALS
    out_normal = vec4(normal_of(hit), 1.0);
#endif
#ifdef ALBEDO
    // that of the nearest texel that shows it
    ivec2 shown = own_texel;
    float closest = 9.0;
    vec2 at = tile.xy + tangent * tile.zw - vec2(own_texel) - 0.5;
    for (uint place = hit.surface == own ? PLACES : 0u; place < PLACES; ++place) {
        ivec2 step = step_to(place);
        vec2 away = vec2(step) - at;
        if (dot(away, away) < closest && texelFetch(u_atlas, own_texel + step, 0).xy == hit.surface) {
            closest = dot(away, away);
            shown = own_texel + step;
        }
    }
    vec3 root = texelFetch(u_albedos, shown, 0).rgb;
    out_albedo = vec4(root * root, 1.0);
#endif
}
