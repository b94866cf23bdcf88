// void write_gloss(): with MATERIALS, writes roughness, metalness and emission; without REFLECTANCE
// those of a matte surface. Call it before any discard: derivatives need the whole 2 x 2 block.

#ifdef MATERIALS
layout(location = 1 + ALBEDO_OUTPUTS) out vec2 out_gloss;  // roughness, metalness
layout(location = 2 + ALBEDO_OUTPUTS) out vec4 out_emission;
#ifdef REFLECTANCE
#include "scene/material_values.glsl"

void write_gloss() {
    SurfaceValues values = surface_values(texture_coordinate());
    out_gloss = vec2(values.roughness, values.metallic);
    out_emission = vec4(values.emissive, 1.0);
}
#else
void write_gloss() {
    out_gloss = vec2(1.0, 0.0);
    out_emission = vec4(vec3(0.0), 1.0);
}
#endif
#else
void write_gloss() {}
#endif
