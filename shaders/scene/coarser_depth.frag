// Coarser level of the shadow maps: depth of the first of four texels.
#version 450 core

uniform sampler2D u_finer;  // finer level only, unfiltered

void main() {
    vec2 size = vec2(textureSize(u_finer, 0));
    gl_FragDepth = textureLod(u_finer, (2.0 * floor(gl_FragCoord.xy) + 0.5) / size, 0.0).r;
}
