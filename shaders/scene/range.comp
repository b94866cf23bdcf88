// Ranges of a scanner's beams to the triangles of draw items, each with its own work groups.
// The scan plane, z = 0 of the scanner's frame, cuts a triangle along a segment. The hits of all
// beams that cross the segment follow from its ends, so a range is exact up to float rounding:
// there are no pixels, no depth buffer and no near plane. Both sides of a surface reflect. A
// triangle that lies in the plane is not hit.
//
// u_first_item, u_end_item  items of this dispatch, as a range of the table
// u_first_group             first work group of the dispatch, counted over all items
// u_angle_min, u_angle_increment  angles of the beams, radians, counter-clockwise
//
// With HOLES, beams pass where alpha is below the item's cutoff; with TEXTURED, it has a texture.
#version 450 core

layout(local_size_x = 32) in;
const uint TRIANGLES = 8u;  // per invocation, at most

#include "scene/vertex_words.glsl"
layout(std430, binding = 2) readonly buffer Beams { vec2 beams[]; };  // unit directions
layout(std430, binding = 3) buffer Ranges { uint range_bits[]; };     // ordered like floats >= 0

struct Item {  // as in omnisim/rendering/opengl/hits/range_pass.py
    mat4 scanner_from_mesh;  // to the scanner's frame: x forward, y left, z up, meters
    uint first;              // first index
    uint triangles;
    uint first_group;        // first work group
    uint layer;              // layer of the texture array
    float base_alpha;
    float alpha_cutoff;
    uint unused[2];
};
layout(std430, binding = 4) readonly buffer Items { Item items[]; };  // by first_group

uniform uint u_first_item;
uniform uint u_end_item;
uniform uint u_first_group;
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

vec3 position_of(mat4 scanner_from_mesh, uint at) {
    precise vec3 position = (scanner_from_mesh * vec4(position_at(at), 1.0)).xyz;
    return position;
}

float height(mat4 scanner_from_mesh, uint index) {
    return position_of(scanner_from_mesh, vertex_at(index)).z;
}

bool crosses_plane(vec3 heights) {
    bvec3 above = greaterThanEqual(heights, vec3(0.0));
    return any(above) && !all(above);
}

Corner corner(mat4 scanner_from_mesh, uint index) {
    uint at = vertex_at(index);
    vec3 position = position_of(scanner_from_mesh, at);
    vec3 surface = vec3(0.0);
#ifdef HOLES
    uint there = at + TEXTURE_COORDINATE_WORD;
    surface.xy = uintBitsToFloat(uvec2(vertex_word(there), vertex_word(there + 1u)));
    surface.z = unpackHalf2x16(vertex_word(at + ALPHA_WORD)).y;
#endif
    return Corner(position, surface);
}

#ifdef HOLES
#ifdef TEXTURED
uniform sampler2DArray u_textures;
#endif

bool is_hole(uint item, vec3 surface) {
    float alpha = items[item].base_alpha * surface.z;
#ifdef TEXTURED
    // beams have no width, so the finest level applies
    alpha *= textureLod(u_textures, vec3(surface.xy, float(items[item].layer)), 0.0).a;
#endif
    return alpha < items[item].alpha_cutoff;
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

void try_beam(uint item, uint beam, Corner start, Corner end) {
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
    if (is_hole(item, mix(start.surface, end.surface, t))) return;
#endif
    atomicMin(range_bits[beam], bits);
}

// Casts beams at a triangle that crosses the plane.
void cast_beams(uint item, mat4 scanner_from_mesh, uint first) {
    Corner a = corner(scanner_from_mesh, first), b = corner(scanner_from_mesh, first + 1u),
           c = corner(scanner_from_mesh, first + 2u);
    bvec3 above = greaterThanEqual(vec3(a.position.z, b.position.z, c.position.z), vec3(0.0));
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
            try_beam(item, uint(beam), start, end);
        }
    }
}

// Item of a work group, by bisection.
uint item_of(uint group) {
    uint item = u_first_item, end = u_end_item;
    while (end - item > 1u) {
        uint middle = (item + end) / 2u;
        if (items[middle].first_group <= group) item = middle;
        else end = middle;
    }
    return item;
}

void main() {
    uint group = u_first_group + gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x;
    uint item = item_of(group);
    group -= items[item].first_group;
    mat4 scanner_from_mesh = items[item].scanner_from_mesh;
    uint first = items[item].first, end = first + 3u * items[item].triangles;
    uint step = 3u * gl_WorkGroupSize.x;
    first += TRIANGLES * group * step + 3u * gl_LocalInvocationID.x;
    // few triangles reach the plane: they are found first, so that no invocation waits for the rest
    uint reaching = 0u, at = first;
    for (uint bit = 1u; bit < 1u << TRIANGLES && at < end; bit <<= 1) {
        if (crosses_plane(vec3(height(scanner_from_mesh, at), height(scanner_from_mesh, at + 1u),
                               height(scanner_from_mesh, at + 2u)))) reaching |= bit;
        at += step;
    }
    for (; reaching != 0u; reaching &= reaching - 1u)
        cast_beams(item, scanner_from_mesh, first + uint(findLSB(reaching)) * step);
}
