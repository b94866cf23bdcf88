// Triangle ID that a texel shows: 1 + its ID, see triangle_ids.py; 0: nothing.
// With ALPHA_MASK only where alpha reaches the cutoff: a blended surface has one, too.
// With ALBEDO also the plain base color: its square root, for which 8 bits are as fine as sRGB's.
// With MATERIALS roughness, metalness and emission, of surfaces without REFLECTANCE those of matte
// ones. ALPHA_MASK and ALBEDO come with COLORED.
#version 450 core

#include "scene/material.glsl"

flat in uint v_first_plus_one;
layout(location = 0) out uint out_id_plus_one;

#ifdef ALBEDO
layout(location = 1) out vec4 out_albedo;
#define GLOSS_LOCATION 2
#define EMISSION_LOCATION 3
#else
#define GLOSS_LOCATION 1
#define EMISSION_LOCATION 2
#endif
#ifdef MATERIALS
layout(location = GLOSS_LOCATION) out vec2 out_gloss;  // roughness, metalness
layout(location = EMISSION_LOCATION) out vec4 out_emission;
#ifdef REFLECTANCE
#include "scene/material_values.glsl"
#endif
#endif

#if defined(TEXTURED) || defined(TEXTURE_COORDINATES)
in vec2 v_texture_coordinate;
#endif
#ifdef COLORED
in vec4 v_color;
#endif

void main() {
#ifdef COLORED
    vec4 color = v_color;
#endif
#ifdef TEXTURED
    color *= texture_color(v_texture_coordinate);
#endif
#ifdef MATERIALS
    out_gloss = vec2(1.0, 0.0);
    out_emission = vec4(vec3(0.0), 1.0);
#ifdef REFLECTANCE
    // before any discard: derivatives need the whole 2 x 2 block
#ifdef TEXTURE_COORDINATES
    SurfaceValues values = surface_values(v_texture_coordinate);
#else
    SurfaceValues values = surface_values(vec2(0.0));
#endif
    out_gloss = vec2(values.roughness, values.metallic);
    out_emission.rgb = values.emissive;
#endif
#endif
#ifdef ALPHA_MASK
    if (color.a < ALPHA_CUTOFF) discard;
#endif
    out_id_plus_one = v_first_plus_one + uint(gl_PrimitiveID);
#ifdef ALBEDO
    out_albedo = vec4(sqrt(color.rgb), 1.0);
#endif
}
