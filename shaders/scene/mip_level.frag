// Texel of a mip level: the mean of the texels of the finer level that it covers.
// With ARRAY of a layer of a texture array: u_layer, or with LAYERED that of the target.
#version 450 core

#ifdef ARRAY
uniform sampler2DArray u_finer;  // filters linearly, and has no level but the finer one
#ifdef LAYERED
flat in float v_layer;
#else
uniform float u_layer;
#endif
#else
uniform sampler2D u_finer;  // likewise
#endif
uniform vec2 u_texels;  // 1 / size of the target

out vec4 o_color;

void main() {
    vec2 at = gl_FragCoord.xy * u_texels;
#if defined(LAYERED)
    o_color = texture(u_finer, vec3(at, v_layer));
#elif defined(ARRAY)
    o_color = texture(u_finer, vec3(at, u_layer));
#else
    o_color = texture(u_finer, at);
#endif
}
