// Inputs of a fragment's material, see scene/material.glsl.
// void pass_material(): passes texture coordinates, with TEXTURED or TEXTURE_COORDINATES; for
//     clusters, whose draw calls have many materials, also texture layer and alpha cutoff.
// vec4 vertex_color(): linear base color.

#if defined(TEXTURED) || defined(TEXTURE_COORDINATES)
layout(location = 2) in vec2 in_texture_coordinate;
out vec2 v_texture_coordinate;

void pass_texture_coordinate() {
    v_texture_coordinate = in_texture_coordinate;
}
#else
void pass_texture_coordinate() {}
#endif

#if defined(CLUSTERED) && (defined(TEXTURED) || defined(ALPHA_MASK) || defined(ALPHA_BLEND))
layout(location = 4) in vec2 in_material;
flat out vec2 v_material;

void pass_layer_and_cutoff() {
    v_material = in_material;
}
#else
void pass_layer_and_cutoff() {}
#endif

void pass_material() {
    pass_texture_coordinate();
    pass_layer_and_cutoff();
}

layout(location = 3) in vec4 in_color;  // for clusters, multiplied by the material's color
#ifdef CLUSTERED
vec4 vertex_color() {
    return in_color;
}
#else
uniform vec4 u_base_color;

vec4 vertex_color() {
    return u_base_color * in_color;
}
#endif
