// Texture and cutoff of a fragment's material.
// vec4 texture_color(vec2 uv): of the material's texture.
// ALPHA_CUTOFF: alpha below which nothing is seen.
// With CLUSTERED the texture is a layer of an array, as many materials share a draw call.

#ifdef CLUSTERED
#if defined(TEXTURED) || defined(ALPHA_MASK)
flat in vec2 v_material;
#endif
#define ALPHA_CUTOFF v_material.y
#ifdef TEXTURED
uniform sampler2DArray u_textures;

vec4 texture_color(vec2 uv) {
    return texture(u_textures, vec3(uv, v_material.x));
}
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
