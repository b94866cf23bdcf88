// Vertex of a planar mirror, see scene/vertex.glsl.
#version 450 core

#include "scene/vertex.glsl"

void main() {
    gl_Position = clip_position();
}
