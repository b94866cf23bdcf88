// void emit(bool valid, vec3 ray): what the ray of a pixel hits, exactly; the ray in the optical
// frame, of any length.
//
// The atlas says which triangles are seen around the ray. Those are cut with the ray itself, and
// the nearest one counts: nothing is blended, no texel's edge is seen, and the distance is as
// exact as floats are. "Here" has the world's axes and its origin in the viewpoint, metres.

#include "capture/cube_faces.glsl"
#include "scene/vertex_words.glsl"

struct DrawRecord {
    mat4 here_from_mesh;
    mat4 normal_from_mesh;  // cofactors, see scene_buffers.py; its last row and column count nothing
    uvec4 first_holed;      // first index, 1 where the material has holes, unused
};
layout(std430, binding = 2) readonly buffer Draws { DrawRecord draws[]; };

uniform usampler2D u_atlas;  // as visibility.frag writes it
uniform mat3 u_here_from_optical;
uniform vec2 u_depth_limits_m;  // near and far plane of the faces

layout(location = 0) out vec4 out_hit;       // here; range, infinite: nothing is hit
layout(location = 1) out uvec2 out_surface;  // as in the atlas
layout(location = 2) out vec4 out_normal;    // here, unit; 1 where the pixel is valid
#ifdef ALBEDO
uniform sampler2D u_albedos;
layout(location = 3) out vec4 out_albedo;
#endif

const float INFINITE = uintBitsToFloat(0x7F800000u);
// A ray between two triangles may miss both by rounding, a micrometre at 20 m: it hits the nearer.
const float EDGE_RAD = 2e-7;

struct Triangle {
    vec3 a, b, c;  // corners, here
    vec3 normal;   // of its plane, towards the viewpoint, not of unit length
};

struct Cut {
    float missed_rad;  // how far outside of the triangle the ray passes; negative: inside
    float range;       // to the triangle's plane
    vec3 weights;      // of the corners, not normalised
};

Triangle triangle_of(uvec2 surface) {
    DrawRecord draw = draws[surface.x - 1u];
    uint first = draw.first_holed.x + 3u * surface.y;
    Triangle t;
    t.a = (draw.here_from_mesh * vec4(position_at(vertex_at(first)), 1.0)).xyz;
    t.b = (draw.here_from_mesh * vec4(position_at(vertex_at(first + 1u)), 1.0)).xyz;
    t.c = (draw.here_from_mesh * vec4(position_at(vertex_at(first + 2u)), 1.0)).xyz;
    t.normal = cross(t.b - t.a, t.c - t.a);
    t.normal *= dot(t.normal, t.a) > 0.0 ? -1.0 : 1.0;
    return t;
}

// An edge and the viewpoint span a plane; the ray's sine to it tells the side that it passes on.
// Differences of corners, which are exact enough where the corners themselves are far away.
Cut cut(Triangle t, vec3 ray) {
    vec3 ab = cross(t.a, t.b - t.a), bc = cross(t.b, t.c - t.b), ca = cross(t.c, t.a - t.c);
    vec3 sides = vec3(dot(ray, bc), dot(ray, ca), dot(ray, ab));
    // the viewpoint is on the normal's side: a ray that comes in passes all edges on one side
    float side = dot(cross(t.b - t.a, t.c - t.a), t.a) > 0.0 ? 1.0 : -1.0;
    sides *= side;
    vec3 missed = -sides * inversesqrt(max(vec3(dot(bc, bc), dot(ca, ca), dot(ab, ab)), 1e-30));
    Cut result;
    result.missed_rad = max(max(missed.x, missed.y), missed.z);
    result.range = dot(t.normal, t.a) / min(dot(t.normal, ray), -1e-30);
    result.weights = sides;
    return result;
}

void emit(bool valid, vec3 ray) {
    out_hit = vec4(0.0, 0.0, 0.0, INFINITE);
    out_surface = uvec2(0u);
    out_normal = vec4(0.0, 0.0, 0.0, valid ? 1.0 : 0.0);
#ifdef ALBEDO
    out_albedo = vec4(0.0);
#endif
    if (!valid) return;

    ray = normalize(ray);
    vec3 rig = u_rig_from_optical * ray;
    int face = face_of(rig);
    vec3 local = u_face_from_rig[face] * rig;
    vec2 tangent = clamp(local.xy / local.z, u_face_window[face].xy, u_face_window[face].zw);
    vec4 tile = u_face_tile[face] * vec2(textureSize(u_atlas, 0)).xyxy;
    ivec2 own_texel = ivec2(floor(tile.xy + tangent * tile.zw));
    uvec2 own = texelFetch(u_atlas, own_texel, 0).xy;

    vec3 here = u_here_from_optical * ray;
    vec2 limits = u_depth_limits_m / local.z;  // along the ray
    float nearest = INFINITE;
    uvec2 surface = uvec2(0u);
    vec3 weights = vec3(0.0);
    float least_missed = 1.0;
    uvec2 least = uvec2(0u);
    bool beside_nothing = own.x == 0u;
    uvec2 before = uvec2(0u);
    for (int number = 0; number < 9; ++number) {
        // its own texel first
        int place = number == 0 ? 4 : (number <= 4 ? number - 1 : number);
        ivec2 texel = own_texel + ivec2(place % 3 - 1, place / 3 - 1);
        uvec2 seen = number == 0 ? own : texelFetch(u_atlas, texel, 0).xy;
        if (seen.x == 0u) {
            beside_nothing = true;
            continue;
        }
        if (number > 0 && (seen == own || seen == before)) continue;
        before = seen;
        if (draws[seen.x - 1u].first_holed.y != 0u && seen != own) continue;
        Cut found = cut(triangle_of(seen), here);
        if (found.range < limits.x || found.range > limits.y) continue;
        if (found.missed_rad < EDGE_RAD) {
            if (found.range < nearest) {
                nearest = found.range;
                surface = seen;
                weights = found.weights;
            }
        } else if (found.missed_rad < least_missed) {
            least_missed = found.missed_rad;
            least = seen;
        }
    }
    // A triangle too small to show in any texel: the one beside it that the ray misses by least.
    if (surface.x == 0u) {
        if (beside_nothing || least.x == 0u) return;
        surface = least;
        weights = cut(triangle_of(least), here).weights;
    }

    Triangle t = triangle_of(surface);
    weights = max(weights, vec3(0.0));
    weights /= max(weights.x + weights.y + weights.z, 1e-30);
    if (isinf(nearest)) {
        nearest = length(weights.x * t.a + weights.y * t.b + weights.z * t.c);
    }
    DrawRecord draw = draws[surface.x - 1u];
    uint first = draw.first_holed.x + 3u * surface.y;
    vec3 smooth_normal = mat3(draw.normal_from_mesh) * (
        weights.x * normal_at(vertex_at(first)) +
        weights.y * normal_at(vertex_at(first + 1u)) +
        weights.z * normal_at(vertex_at(first + 2u)));
    // as scene/surface.frag has it: the side that is seen
    bool is_smooth = dot(smooth_normal, smooth_normal) > 0.0;
    vec3 normal = is_smooth ? smooth_normal : t.normal;
    normal *= dot(normal, t.normal) < 0.0 ? -1.0 : 1.0;
    out_hit = vec4(nearest * here, nearest);
    out_surface = surface;
    out_normal.xyz = normalize(normal);
#ifdef ALBEDO
    ivec2 shown = own_texel;
    float closest = 9.0;
    vec2 at = tile.xy + tangent * tile.zw - vec2(own_texel) - 0.5;
    for (int place = 0; place < 9; ++place) {
        ivec2 step = ivec2(place % 3 - 1, place / 3 - 1);
        vec2 away = vec2(step) - at;
        if (dot(away, away) < closest && texelFetch(u_atlas, own_texel + step, 0).xy == surface) {
            closest = dot(away, away);
            shown = own_texel + step;
        }
    }
    out_albedo = texelFetch(u_albedos, shown, 0);
#endif
}
