// void write_material(vec3 texel, Hit hit): writes the atlas values nearest to the ray: with ALBEDO
// the base color, with MATERIALS roughness, metalness and emission.

#include "ground_truth/nearest_texel.glsl"

#ifdef BATCH
#define ATLAS sampler2DArray
#define value_at(atlas, texel) texelFetch(atlas, ivec3(texel, v_image), 0)
#else
#define ATLAS sampler2D
#define value_at(atlas, texel) texelFetch(atlas, texel, 0)
#endif

#ifdef ALBEDO
#define ALBEDO_OUTPUTS 1
uniform ATLAS u_albedos;
layout(location = FIRST_DETAIL + NORMAL_OUTPUTS) out vec4 out_albedo;

void write_no_albedo() {
    out_albedo = vec4(0.0);
}

void write_albedo(ivec2 nearest) {
    vec3 root = value_at(u_albedos, nearest).rgb;
    out_albedo = vec4(root * root, 1.0);
}
#else
#define ALBEDO_OUTPUTS 0

void write_no_albedo() {}

void write_albedo(ivec2 nearest) {}
#endif

#ifdef MATERIALS
uniform ATLAS u_gloss;  // output of visibility.frag
uniform ATLAS u_emission;
layout(location = FIRST_DETAIL + NORMAL_OUTPUTS + ALBEDO_OUTPUTS) out vec4 out_gloss;
layout(location = FIRST_DETAIL + NORMAL_OUTPUTS + ALBEDO_OUTPUTS + 1) out vec4 out_emission;

void write_no_gloss() {
    out_gloss = out_emission = vec4(0.0);
}

void write_gloss(ivec2 nearest) {
    out_gloss = value_at(u_gloss, nearest);
    out_emission = value_at(u_emission, nearest);
}
#else
void write_no_gloss() {}

void write_gloss(ivec2 nearest) {}
#endif

#if defined(ALBEDO) || defined(MATERIALS)
void write_material(vec3 texel, Hit hit) {
    ivec2 nearest = nearest_texel(texel, hit);
    write_albedo(nearest);
    write_gloss(nearest);
}
#else
void write_material(vec3 texel, Hit hit) {}
#endif
