// Pixels of a non-central camera, from the atlas of one viewpoint. The surface of each sample is
// predicted on the plane through the surfaces of the pixel and its four neighbors. A sample whose
// prediction agrees with the atlas gets its color here; parallax_samples.frag renders the others.
// There are no branches, because software drivers execute all of them.
// With MIP_LEVELS, the atlas has mip levels.
#version 450 core

uniform sampler2D u_surfaces;  // output of surfaces.frag

layout(location = 0) out vec4 out_color;  // sum of colors / SAMPLES; share of samples with a ray
layout(location = 1) out uvec2 out_left;  // bit mask of the samples without a color, row by row

#include "capture/first_surface.glsl"
#include "capture/parallax_rays.glsl"
#include "capture/parallax_color.glsl"

const int SAMPLES = SUPERSAMPLING * SUPERSAMPLING;
// Width of the gutter around a tile within which a filtered lookup reads the tile's own texels: the
// gutter of parallax_plan.py minus the filter's reach.
#ifdef MIP_LEVELS
const float GUTTER_TEXELS = 1.0;
#else
const float GUTTER_TEXELS = 1.5;
#endif
const float STRAIGHT_TEXELS = 1.0;  // maximum deviation from a plane, per pixel

// Tangents and inverse depth of a neighbor's surface on the face of the pixel.
vec3 beside(ivec2 pixel, int face, inout bool straight) {
    vec4 surface = texelFetch(u_surfaces, pixel, 0);
    vec3 local = u_face_from_rig[face] * surface.xyz;
    straight = straight && surface.w >= 0.0 && local.z > 0.1;
    return vec3(local.xy, surface.w) / local.z;
}

// True if a tangent on the place's face is in the place's tile.
bool in_tile(Place place, vec2 tangent) {
    ivec2 cell = clamp(ivec2(0.5 * float(CELLS) * (tangent + 1.0)), 0, CELLS - 1);
    vec4 there = texelFetch(u_cells, ivec2(cell.x + CELLS * place.face, cell.y), 0);
    return there == place.cell && all(lessThanEqual(abs(tangent), vec2(1.0)));
}

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    float share = texelFetch(u_rays, pixel + MARGIN, 0).w;
    vec4 own = texelFetch(u_surfaces, pixel, 0);
    vec4 origin = texelFetch(u_origins, pixel + MARGIN, 0);
    bool straight = own.w >= 0.0 && origin.w == 0.0;
    Place place = place_of(own.xyz, origin.xyz);
    vec3 here = vec3(place.tangent, own.w / place.depth);
    ivec2 last = textureSize(u_surfaces, 0) - 1;
    vec3 ends[4] = vec3[4](
        beside(min(pixel + ivec2(1, 0), last), place.face, straight),
        beside(max(pixel - ivec2(1, 0), 0), place.face, straight),
        beside(min(pixel + ivec2(0, 1), last), place.face, straight),
        beside(max(pixel - ivec2(0, 1), 0), place.face, straight));
    vec3 right = 0.5 * (ends[0] - ends[1]), down = 0.5 * (ends[2] - ends[3]);
    vec2 bends = max(abs(ends[0].xy + ends[1].xy - 2.0 * here.xy),
                     abs(ends[2].xy + ends[3].xy - 2.0 * here.xy));
    straight = straight && max(bends.x, bends.y) * place.cell.z < STRAIGHT_TEXELS;
    // beyond its gutter a tile has no texels, and depth cannot reveal that in the sky
    vec2 reach = abs(offset_of(0).x) * (abs(right.xy) + abs(down.xy));
    vec2 past = max(reach - GUTTER_TEXELS / abs(place.cell.zw), 0.0);
    straight = straight && in_tile(place, here.xy + past) && in_tile(place, here.xy - past);
    float level = level_at(pixel, place);
    float tolerance = SAME_TEXELS / (place.depth * place.texels);
    vec3 total = vec3(0.0);
    uint left[2] = uint[2](0u, 0u);
    for (int part = 0; part < SAMPLES; ++part) {
        vec2 offset = offset_of(part);
        vec3 surface = here + offset.x * right + offset.y * down;
        vec2 texel = place.cell.xy + surface.xy * place.cell.zw;
        bool known = straight && abs(inverse_z_at(texel) - surface.z) < tolerance;
        vec3 color = color_along(
            color_at(texel, level), vec3(surface.xy, 1.0), surface.z,
            u_face_from_rig[place.face] * origin.xyz);
        total += known ? color : vec3(0.0);
        left[part / 32] |= known ? 0u : 1u << (part % 32);
    }
    out_color = vec4(total / float(SAMPLES), share);
    out_left = uvec2(left[0], left[1]);
}
