// Depth that lets a mirrored view be drawn in the texels of its mirror, and nowhere else.
#version 450 core

uniform usampler2D u_mirror_owners;
uniform uint u_number;
const float OPEN = 0.0, CLOSED = 1.0;  // the farthest and the nearest reversed depth

void main() {
    uint owner = texelFetch(u_mirror_owners, ivec2(gl_FragCoord.xy), 0).r;
    gl_FragDepth = owner == u_number ? OPEN : CLOSED;
}
