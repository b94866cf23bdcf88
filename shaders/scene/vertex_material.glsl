// Inputs of a fragment's material, see scene/material.glsl.
// void pass_material(): passes texture coordinates, with TEXTURED or TEXTURE_COORDINATES; for
//     clusters, whose draw calls have many materials, also texture layer and alpha cutoff.
// vec4 vertex_color(): linear base color; with BAKED, times the light.
// Clusters have both colors, layer and cutoff in a palette, whose layout is that of
// omnisim/rendering/opengl/world/vertex_format.py.

#if defined(TEXTURED) || defined(TEXTURE_COORDINATES)
layout(location = 1) in vec2 in_texture_coordinate;
out vec2 v_texture_coordinate;

void pass_texture_coordinate() {
    v_texture_coordinate = in_texture_coordinate;
}
#else
void pass_texture_coordinate() {}
#endif

#ifdef CLUSTERED
layout(location = 2) in uint in_material;  // first texel of an entry
layout(binding = 19) uniform sampler2D u_palette;

#ifdef BAKED
const uint COLOR_TEXEL = 2u;
#else
const uint COLOR_TEXEL = 0u;
#endif
const uint LAYER_TEXEL = 1u, PALETTE_ROW_BITS = 14u;

vec4 palette_texel(uint number) {
    uint at = in_material + number, row = at >> PALETTE_ROW_BITS;
    return texelFetch(u_palette, ivec2(at - (row << PALETTE_ROW_BITS), row), 0);
}
#endif

#if defined(CLUSTERED) && (defined(TEXTURED) || defined(ALPHA_MASK) || defined(ALPHA_BLEND))
flat out vec2 v_material;

void pass_layer_and_cutoff() {
    v_material = palette_texel(LAYER_TEXEL).xy;
}
#else
void pass_layer_and_cutoff() {}
#endif

void pass_material() {
    pass_texture_coordinate();
    pass_layer_and_cutoff();
}

#ifdef CLUSTERED
vec4 vertex_color() {
    return palette_texel(COLOR_TEXEL);
}
#else
layout(location = 2) in vec4 in_color;
uniform vec4 u_base_color;

vec4 vertex_color() {
    return u_base_color * in_color;
}
#endif
