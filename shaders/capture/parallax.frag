// Pixels of a camera whose rays do not meet in one point, from the atlas of one viewpoint: colors of
// those of their samples whose surfaces lie, more or less, on the plane of those that the pixels
// around meet, if the atlas shows each there; and which samples are left (parallax_samples.frag).
// Without branches: software drivers go through all of them.
// With MIP_LEVELS the atlas has some.
#version 450 core

uniform sampler2D u_surfaces;  // of pixels, as surfaces.frag has them

layout(location = 0) out vec4 out_color;  // sum as a share of all samples; share that has rays
layout(location = 1) out uvec2 out_left;  // bits of the samples, row by row

#include "capture/first_surface.glsl"
#include "capture/parallax_rays.glsl"
#include "capture/parallax_color.glsl"

const int SAMPLES = SUPERSAMPLING * SUPERSAMPLING;
// Past a tile of which look-ups still find its own, by the gutter of parallax_plan.py less what they
// mix.
#ifdef MIP_LEVELS
const float GUTTER_TEXELS = 1.0;
#else
const float GUTTER_TEXELS = 1.5;
#endif
const float STRAIGHT_TEXELS = 1.0;  // surfaces that differ from a plane by less, per pixel

// Tangents and inverse depth of the surface of a neighbor, as the pixel's own face has them.
vec3 beside(ivec2 pixel, int face, inout bool straight) {
    vec4 surface = texelFetch(u_surfaces, pixel, 0);
    vec3 local = u_face_from_rig[face] * surface.xyz;
    straight = straight && surface.w >= 0.0 && local.z > 0.1;
    return vec3(local.xy, surface.w) / local.z;
}

// A tangent of the place's face is in the place's own tile.
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
    // past its gutter a tile has nothing: where the sky is seen, no depth tells
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
