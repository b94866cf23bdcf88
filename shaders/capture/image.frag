// Image pixels: mean of their valid samples, linear and encoded in sRGB. A pixel is valid if at
// least half of its samples are.
// With REMAP, a table has the atlas's texture coordinates of each sample, and with MIP_LEVELS
// another one its mip level. With UVS, textures have both, from the pixel u_first_px on. Without
// either, samples are the pixels of a finer image.
// With BATCH, images are stacked vertically; each reads its own layer of the atlas.
// SUPERSAMPLING: samples per pixel side; a constant, so that the loops unroll.
#version 450 core

const int SAMPLES = SUPERSAMPLING * SUPERSAMPLING;
#ifdef BATCH
uniform sampler2DArray u_samples;
flat in int v_image;
#define at_layer(uv) vec3(uv, float(v_image))
#else
uniform sampler2D u_samples;  // atlas, or finer image
#define at_layer(uv) uv
#endif
#ifdef REMAP
// Texture coordinates of the samples, pixel by pixel; negative: invalid.
layout(std430, binding = 5) readonly buffer Uvs { vec2 uvs[]; };
#ifdef MIP_LEVELS
layout(std430, binding = 6) readonly buffer Levels { float levels[]; };
#endif
uniform vec2 u_image_size_px;
#endif
#ifdef UVS
uniform sampler2D u_uvs;
uniform sampler2D u_levels;
uniform ivec2 u_first_px;
#endif
layout(location = 0) out vec4 out_encoded;
layout(location = 1) out vec4 out_linear;
#include "common/srgb.glsl"

vec4 sample_at(ivec2 pixel, ivec2 part) {
#ifdef REMAP
    int width_px = int(u_image_size_px.x);
    int at = (pixel.y * width_px + pixel.x) * SAMPLES + part.y * SUPERSAMPLING + part.x;
#ifdef MIP_LEVELS
    vec3 color = textureLod(u_samples, at_layer(uvs[at]), levels[at]).rgb;
#else
    vec3 color = texture(u_samples, at_layer(uvs[at])).rgb;  // faster than textureLod
#endif
    return uvs[at].x < 0.0 ? vec4(0.0) : vec4(color, 1.0);
#elif defined(UVS)
    ivec2 at = (pixel - u_first_px) * SUPERSAMPLING + part;
    vec2 uv = texelFetch(u_uvs, at, 0).xy;
#ifdef MIP_LEVELS
    vec3 color = textureLod(u_samples, uv, texelFetch(u_levels, at, 0).x).rgb;
#else
    vec3 color = texture(u_samples, uv).rgb;
#endif
    return uv.x < 0.0 ? vec4(0.0) : vec4(color, 1.0);
#else
    return texelFetch(u_samples, pixel * SUPERSAMPLING + part, 0);  // 0 if invalid
#endif
}

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
#ifdef BATCH
    pixel.y -= v_image * int(u_image_size_px.y);
#endif
    vec4 total = vec4(0.0);
    for (int row = 0; row < SUPERSAMPLING; ++row)
        for (int column = 0; column < SUPERSAMPLING; ++column)
            total += sample_at(pixel, ivec2(column, row));
    bool valid = 2.0 * total.a >= float(SAMPLES);
    out_linear = valid ? vec4(total.rgb / total.a, 1.0) : vec4(0.0);
    out_encoded = vec4(srgb_from_linear(clamp(out_linear.rgb, 0.0, 1.0)), out_linear.a);
}
