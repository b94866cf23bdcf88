// Texel of a mip level: the mean of the texels of the finer level that it covers.
#version 450 core

#ifdef LAYERED
uniform sampler2DArray u_finer;  // filters linearly, and has no level but the finer one

flat in float v_layer;
#else
uniform sampler2D u_finer;  // likewise
#endif
uniform vec2 u_texels;  // 1 / size of the target

out vec4 o_color;

void main() {
    vec2 at = gl_FragCoord.xy * u_texels;
#ifdef LAYERED
    o_color = texture(u_finer, vec3(at, v_layer));
#else
    o_color = texture(u_finer, at);
#endif
}
