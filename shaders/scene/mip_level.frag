// Texel of a mip level: mean of the finer level's texels that it covers.
// With ARRAY, the texture is an array; its layer is u_layer, or with LAYERED the target's layer.
#version 450 core

#ifdef ARRAY
uniform sampler2DArray u_finer;  // finer level only, linear filter
#ifdef LAYERED
flat in float v_layer;
#else
uniform float u_layer;
#endif
#else
uniform sampler2D u_finer;  // finer level only, linear filter
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
