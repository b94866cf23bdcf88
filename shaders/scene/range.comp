// Ranges of a scanner's beams to the triangles of one draw call; one invocation per triangle.
// The scan plane, z = 0 of the scanner's frame, cuts a triangle along a segment. The hits of all
// beams that cross the segment follow from its ends, so a range is exact up to float rounding:
// there are no pixels, no depth buffer and no near plane. Both sides of a surface reflect. A
// triangle that lies in the plane is not hit.
//
// u_scanner_from_mesh  transform to the scanner's frame: x forward, y left, z up, meters
// u_first              first index of the draw call
// u_triangles          number of triangles of the draw call
// u_angle_min, u_angle_increment  angles of the beams, radians, counter-clockwise
//
// With HOLES, beams pass where alpha is below u_alpha_cutoff.
#version 450 core

layout(local_size_x = 64) in;

#include "scene/vertex_words.glsl"
layout(std430, binding = 2) readonly buffer Beams { vec2 beams[]; };  // unit directions
layout(std430, binding = 3) buffer Ranges { uint range_bits[]; };     // ordered like floats >= 0

uniform mat4 u_scanner_from_mesh;
uniform uint u_first;
uniform uint u_triangles;
uniform float u_angle_min;
uniform float u_angle_increment;

const float PI = 3.14159265358979;
// GLSL allows atan an error of 4096 units in the last place, 1e-3 of pi. Beams slightly outside the
// segment are therefore tried as well; the exact test below decides.
const float ATAN_ERROR = 2e-3;

struct Corner {
    vec3 position;  // scanner frame
    vec3 surface;   // texture coordinates and alpha, for holes
};

Corner corner(uint index) {
    uint at = vertex_at(index);
    precise vec3 position = (u_scanner_from_mesh * vec4(position_at(at), 1.0)).xyz;
    vec3 surface = vec3(0.0);
#ifdef HOLES
    uint there = at + TEXTURE_COORDINATE_WORD;
    surface.xy = uintBitsToFloat(uvec2(vertex_word(there), vertex_word(there + 1u)));
    surface.z = unpackHalf2x16(vertex_word(at + ALPHA_WORD)).y;
#endif
    return Corner(position, surface);
}

#ifdef HOLES
uniform sampler2D u_texture;  // white for a material without a texture
uniform float u_base_alpha;
uniform float u_alpha_cutoff;

bool is_hole(vec3 surface) {
    // beams have no width, so the finest level applies
    float alpha = u_base_alpha * surface.z * textureLod(u_texture, surface.xy, 0.0).a;
    return alpha < u_alpha_cutoff;
}
#endif

// Point where the edge between a corner above and a corner below crosses the plane. This order
// makes the point bit-identical for both triangles at the edge, so no beam slips between them.
Corner crossing(Corner above, Corner below) {
    precise float t = above.position.z / (above.position.z - below.position.z);
    precise vec3 position = above.position + t * (below.position - above.position);
    return Corner(position, mix(above.surface, below.surface, t));
}

float cross2(vec2 a, vec2 b) {
    precise float value = a.x * b.y - a.y * b.x;
    return value;
}

void try_beam(uint beam, Corner start, Corner end) {
    vec2 direction = beams[beam];
    float side_start = cross2(direction, start.position.xy);
    float side_end = cross2(direction, end.position.xy);
    bool misses = min(side_start, side_end) > 0.0 || max(side_start, side_end) < 0.0;
    if (misses || side_start == side_end) return;  // equal: the segment is seen end-on
    float t = side_start / (side_start - side_end);
    float range = mix(dot(direction, start.position.xy), dot(direction, end.position.xy), t);
    if (!(range >= 0.0)) return;
    uint bits = floatBitsToUint(range);
    if (bits >= range_bits[beam]) return;
#ifdef HOLES
    if (is_hole(mix(start.surface, end.surface, t))) return;
#endif
    atomicMin(range_bits[beam], bits);
}

void main() {
    uint group = gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x;
    uint triangle = group * gl_WorkGroupSize.x + gl_LocalInvocationID.x;
    if (triangle >= u_triangles) return;
    uint first = u_first + 3u * triangle;
    Corner a = corner(first), b = corner(first + 1u), c = corner(first + 2u);
    bvec3 above = greaterThanEqual(vec3(a.position.z, b.position.z, c.position.z), vec3(0.0));
    if (all(above) || !any(above)) return;

    // rotate the corners until the first is alone on its side of the plane
    if (above.x == above.y) {
        Corner last = c;
        c = b;
        b = a;
        a = last;
        above = above.zxy;
    } else if (above.x == above.z) {
        Corner second = b;
        b = c;
        c = a;
        a = second;
        above = above.yzx;
    }
    Corner start, end;
    if (above.x) {
        start = crossing(a, b);
        end = crossing(a, c);
    } else {
        start = crossing(b, a);
        end = crossing(c, a);
    }

    float sweep = atan(cross2(start.position.xy, end.position.xy),
                      dot(start.position.xy, end.position.xy));
    float from = atan(start.position.y, start.position.x);
    float low = min(from, from + sweep) - ATAN_ERROR, high = max(from, from + sweep) + ATAN_ERROR;
    float last = float(beams.length() - 1);
    for (float whole_turn = -2.0 * PI; whole_turn < 7.0; whole_turn += 2.0 * PI) {
        float shift = whole_turn - u_angle_min;
        float first_beam = max(ceil((low + shift) / u_angle_increment), 0.0);
        float last_beam = min(floor((high + shift) / u_angle_increment), last);
        for (float beam = first_beam; beam <= last_beam; beam += 1.0) {
            try_beam(uint(beam), start, end);
        }
    }
}
