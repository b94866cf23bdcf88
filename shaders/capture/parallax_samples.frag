// Single samples of a camera whose rays do not meet in one point, each along its own ray: linear
// colour, and 1 where it is known what the ray meets.
#version 430 core

uniform usampler2D u_samples;  // one a texel of the target: 64 * pixel, row by row, + part of it
uniform int u_width_px;        // of the picture

layout(location = 0) out vec4 out_color;

#define GUESS
#include "capture/first_surface.glsl"
#include "capture/parallax_rays.glsl"
#include "capture/parallax_color.glsl"

void main() {
    uint at = texelFetch(u_samples, ivec2(gl_FragCoord.xy), 0).x;
    int number = int(at / 64u);
    ivec2 pixel = ivec2(number % u_width_px, number / u_width_px);
    Ray ray = ray_of(pixel, int(at % 64u));
    FirstSurface found = first_surface(ray.direction, ray.origin);
    Place place = place_of(ray.direction + found.nearness * ray.origin, ray.origin);
    out_color = vec4(color_at(place.texel, level_at(pixel, place)), found.known ? 1.0 : 0.0);
}
