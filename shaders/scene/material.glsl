// Color, holes and hidden sides of a fragment's material.
// vec2 texture_coordinate(): texture coordinate, with TEXTURED or TEXTURE_COORDINATES; else 0.
// vec4 texture_color(): color of the material's texture, with TEXTURED; else 1.
// void discard_hole(float alpha): with ALPHA_MASK, discards fragments below the material's cutoff.
// void discard_hidden_side(), bool is_unlit(): flags of blended materials, which share a program.
// With CLUSTERED, the texture is a layer of an array, because many materials share a draw call.

#if defined(TEXTURED) || defined(TEXTURE_COORDINATES)
in vec2 v_texture_coordinate;

vec2 texture_coordinate() {
    return v_texture_coordinate;
}
#else
vec2 texture_coordinate() {
    return vec2(0.0);
}
#endif

#if defined(CLUSTERED) && (defined(TEXTURED) || defined(ALPHA_MASK) || defined(ALPHA_BLEND))
flat in vec2 v_material;  // texture layer, and alpha cutoff
#endif

#ifdef BLENDED_ARRAYS
// In place of the cutoff: number of the texture array and flags, as in blended_drawer.py.
#define ARRAY_BITS 7
#define UNLIT_BIT 8
#define DOUBLE_SIDED_BIT 16
#define MATERIAL_KIND int(v_material.y)

bool is_unlit() {
    return (MATERIAL_KIND & UNLIT_BIT) != 0;
}

void discard_hidden_side() {
    if (!gl_FrontFacing && (MATERIAL_KIND & DOUBLE_SIDED_BIT) == 0) discard;
}
#else
bool is_unlit() {
    return false;
}

void discard_hidden_side() {}
#endif

#ifndef TEXTURED
vec4 texture_color() {
    return vec4(1.0);
}
#elif defined(BLENDED_ARRAYS)
uniform sampler2DArray u_textures[BLENDED_ARRAYS];

vec4 texture_color() {
    vec4 color = vec4(1.0);
    int own = MATERIAL_KIND & ARRAY_BITS;
    // sample all arrays: derivatives need the whole 2 x 2 block
    for (int array = 0; array < BLENDED_ARRAYS; ++array) {
        vec4 of_array = texture(u_textures[array], vec3(texture_coordinate(), v_material.x));
        if (array == own) color = of_array;
    }
    return color;
}
#elif defined(CLUSTERED)
uniform sampler2DArray u_textures;

vec4 texture_color() {
    return texture(u_textures, vec3(texture_coordinate(), v_material.x));
}
#else
uniform sampler2D u_texture;

vec4 texture_color() {
    return texture(u_texture, texture_coordinate());
}
#endif

#ifndef ALPHA_MASK
void discard_hole(float alpha) {}
#elif defined(CLUSTERED)
void discard_hole(float alpha) {
    if (alpha < v_material.y) discard;
}
#else
uniform float u_alpha_cutoff;

void discard_hole(float alpha) {
    if (alpha < u_alpha_cutoff) discard;
}
#endif
