// Surface of the scene: linear base color, lit or not. All colors are linear; textures are stored
// as sRGB, which the sampler decodes.
#version 450 core

#include "scene/material.glsl"
#include "scene/surface_normal.glsl"
#include "scene/fog.glsl"
#include "scene/surface_light.glsl"

#ifdef BAKED
flat
#endif
in vec4 v_color;  // base color, times light if it is computed at the vertices
#ifdef PANE
layout(location = 0, index = 0) out vec4 out_color;
layout(location = 0, index = 1) out vec4 out_transmittance;  // factor of the light behind
void write_transmittance(vec3 base_color, vec3 triangle_normal) {
    out_transmittance = vec4(transmittance(base_color, triangle_normal), 1.0);
}
#else
layout(location = 0) out vec4 out_color;
void write_transmittance(vec3 base_color, vec3 triangle_normal) {}
#endif

// Light from maps needs derivatives of the whole 2 x 2 block, so it is computed before any discard.
#if defined(REFLECTANCE) || defined(SHADOWS)
const bool LIGHT_NEEDS_DERIVATIVES = true;
#else
const bool LIGHT_NEEDS_DERIVATIVES = false;
#endif
#ifdef ALPHA_BLEND
const bool IS_BLENDED = true;
#else
const bool IS_BLENDED = false;
#endif
const float MAX_HALF_FLOAT = 65504.0;
#ifdef IN_MIRROR
#define OPAQUE -length(surface_position())  // as in scene/planar_mirror.glsl
#else
#define OPAQUE 1.0
#endif

void main() {
    vec4 color = v_color * texture_color();
    vec3 triangle_normal = normal_of_triangle();
    discard_hidden_side();
    if (!LIGHT_NEEDS_DERIVATIVES) discard_hole(color.a);
    vec3 light = lit_color(color.rgb, triangle_normal);
    write_transmittance(color.rgb, triangle_normal);
    if (LIGHT_NEEDS_DERIVATIVES) discard_hole(color.a);
    light = fogged(light, fog_range(surface_position()));
    // near a punctual light the value is unbounded; infinity would spoil mip levels
    out_color = vec4(min(light, vec3(MAX_HALF_FLOAT)), IS_BLENDED ? color.a : OPAQUE);
}
