// Hit of each pixel's ray, whose origin is beside the viewpoint. Candidates are the triangles that
// the viewpoint sees at the ray's end, which is found by depth (first_surface.glsl).
#version 450 core

vec3 ray_origin = vec3(0.0);  // viewpoint frame
#define GUESS
#include "capture/first_surface.glsl"
#include "ground_truth/intersect.glsl"
#include "ground_truth/pixel_rays.glsl"
#include "ground_truth/hit_outputs.glsl"

uniform sampler2D u_origins;  // ray origins relative to the viewpoint, optical frame
uniform mat3 u_rig_from_optical;
// Bit of a draw item's number: the viewpoint does not see the ray's end.
const uint UNKNOWN = 0x80000000u;
const int ROUNDS = 3;
const float IN_FRONT = 1.005;  // ratio of inverse depths above which a texel is in front of a plane

struct Ending {
    Hit hit;
    vec3 texel;
    bool known;
};

// True if a neighboring texel shows something in front of the hit plane. It may extend to the ray,
// but be too thin for the ray's own texel.
bool is_beside_nearer(Hit hit, Place place, vec3 ray) {
    vec3 normal = u_face_from_rig[place.face] * u_rig_from_optical *
        (transpose(viewpoint_from_optical()) * hit.normal);
    float scale = hit.primitive.x == 0u ? 0.0 :
        1.0 / dot(hit.normal, ray_origin + hit.range * ray);
    bool is_nearer = false;
    for (uint at = 0u; at < TEXELS; ++at) {
        vec2 texel = floor(place.texel) + 0.5 + vec2(texel_offset(at));
        vec2 tangent = (texel - place.cell.xy) / place.cell.zw;
        float of_plane = max(scale * dot(normal, vec3(tangent, 1.0)), 0.0);
        is_nearer = is_nearer || inverse_z_at(texel) > IN_FRONT * of_plane;
    }
    return is_nearer;
}

// Texel depths give the ray's end to within a texel, triangles give it exactly. If a ray just
// misses the surface of its texel, the search continues.
Ending follow(vec3 rig, vec3 rig_origin, vec3 ray) {
    Ending ending;
    ending.known = false;
    float start = largest_nearness();
    // near and far planes are centered on the ray's origin
    float depth = max(max(abs(rig.x), abs(rig.y)), abs(rig.z));
    bool continues = true;
    for (int round = 0; round < ROUNDS && continues; ++round) {
        FirstSurface found = first_surface(rig, rig_origin, start);
        Place place = place_of(rig + found.nearness * rig_origin, rig_origin);
        ending.texel = vec3(place.texel, depth);
        ending.hit = intersect(ending.texel, ray);
        float nearness = ending.hit.primitive.x == 0u ? 0.0 : 1.0 / ending.hit.range;
        bool is_there = (found.nearness - nearness) * place.texels < STEP_TEXELS;
        ending.known = found.known && is_there && !ending.hit.beside &&
            !is_beside_nearer(ending.hit, place, ray);
        continues = found.known && !is_there;
        start = found.nearness - STEP_TEXELS / place.texels;
    }
    return ending;
}

void main() {
    vec4 optical = texelFetch(u_rays, pixel(), 0);
    vec3 ray = viewpoint_from_optical() * optical.xyz;
    write_nothing(ray);
    if (optical.w < 0.5) return;
    vec3 optical_origin = texelFetch(u_origins, pixel(), 0).xyz;
    vec3 rig = u_rig_from_optical * optical.xyz, rig_origin = u_rig_from_optical * optical_origin;
    ray_origin = viewpoint_from_optical() * optical_origin;
    Ending ending = follow(rig, rig_origin, ray);
    if (ending.hit.primitive.x != 0u) write_hit(ray, ray_origin, ending.texel, ending.hit);
    if (!ending.known) out_primitive.x |= UNKNOWN;
}
