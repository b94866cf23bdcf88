// Texture and cutoff of a fragment's material.
// vec4 texture_color(vec2 uv): of the material's texture.
// ALPHA_CUTOFF: alpha below which nothing is seen.
// With CLUSTERED the texture is a layer of an array, as many materials share a draw call.

#ifdef CLUSTERED
#if defined(TEXTURED) || defined(ALPHA_MASK) || defined(ALPHA_BLEND)
flat in vec2 v_material;
#endif
#define ALPHA_CUTOFF v_material.y
#ifdef BLENDED_ARRAYS
// In place of the cutoff the number of the array and flags, as in blended_drawer.py.
#define ARRAY_BITS 7
#define UNLIT_BIT 8
#define DOUBLE_SIDED_BIT 16
#define MATERIAL_KIND int(v_material.y)
#endif
#ifdef TEXTURED
#ifdef BLENDED_ARRAYS
uniform sampler2DArray u_textures[BLENDED_ARRAYS];

vec4 texture_color(vec2 uv) {
    vec4 color = vec4(1.0);
    int own = MATERIAL_KIND & ARRAY_BITS;
    // of all: derivatives need the whole 2 x 2 block
    for (int array = 0; array < BLENDED_ARRAYS; ++array) {
        vec4 of_array = texture(u_textures[array], vec3(uv, v_material.x));
        if (array == own) color = of_array;
    }
    return color;
}
#else
uniform sampler2DArray u_textures;

vec4 texture_color(vec2 uv) {
    return texture(u_textures, vec3(uv, v_material.x));
}
#endif
#endif
#else
#ifdef ALPHA_MASK
uniform float u_alpha_cutoff;
#endif
#define ALPHA_CUTOFF u_alpha_cutoff
#ifdef TEXTURED
uniform sampler2D u_texture;

vec4 texture_color(vec2 uv) {
    return texture(u_texture, uv);
}
#endif
#endif
