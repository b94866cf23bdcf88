// Single samples of a non-central camera, each along its own ray: linear color, and 1 if the ray's
// first surface is known.
#version 450 core

uniform usampler2D u_samples;  // sample per target texel: 64 * pixel number + sample in the pixel
uniform int u_width_px;        // image width

layout(location = 0) out vec4 out_color;

#define GUESS
#include "capture/first_surface.glsl"
#include "capture/parallax_rays.glsl"
#include "capture/parallax_color.glsl"

// True if all texels of a filtered color show surfaces within a texel of parallax from the ray's
// surface. Beside an edge, the background or the foreground would otherwise shine through.
bool is_unmixed(Place place, float nearness, float level) {
    float reach = level > 0.0 ? exp2(ceil(level)) : 0.5;
    vec2 first = place.texel - reach, last = place.texel + reach;
    vec4 found = vec4(inverse_z_at(first), inverse_z_at(vec2(last.x, first.y)),
                      inverse_z_at(vec2(first.x, last.y)), inverse_z_at(last));
    vec4 texels = abs(found * place.depth - nearness) * place.texels;
    return max(max(texels.x, texels.y), max(texels.z, texels.w)) < SAME_TEXELS;
}

void main() {
    uint at = texelFetch(u_samples, ivec2(gl_FragCoord.xy), 0).x;
    int number = int(at / 64u);
    ivec2 pixel = ivec2(number % u_width_px, number / u_width_px);
    Ray ray = ray_of(pixel, int(at % 64u));
    FirstSurface found = first_surface(ray.direction, ray.origin, largest_nearness());
    Place place = place_of(ray.direction + found.nearness * ray.origin, ray.origin);
    float level = level_at(pixel, place);
    bool known = found.known && is_unmixed(place, found.nearness, level);
    vec3 color = color_along(
        color_at(place.texel, level), ray.direction + found.nearness * ray.origin,
        found.nearness, ray.origin);
    out_color = vec4(color, known ? 1.0 : 0.0);
}
