// The mirror's mesh, textured with a face of the cube; the target encodes to sRGB.
#version 430 core

uniform sampler2D u_face;

in vec2 v_texture_coordinate;
layout(location = 0) out vec4 out_color;

void main() {
    out_color = vec4(texture(u_face, v_texture_coordinate).rgb, 1.0);
}
