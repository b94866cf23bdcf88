// Vertex of what casts shadows, see scene/vertex.glsl; with ALPHA_MASK also what makes its holes.
#version 450 core

#include "scene/vertex.glsl"

#ifdef ALPHA_MASK
layout(location = 3) in vec4 in_color;  // of clusters, times the base color
out float v_alpha;
#ifdef CLUSTERED
layout(location = 4) in vec2 in_material;
flat out vec2 v_material;
#else
uniform vec4 u_base_color;
#endif
#ifdef TEXTURED
layout(location = 2) in vec2 in_texture_coordinate;
out vec2 v_texture_coordinate;
#endif
#endif

void main() {
    gl_Position = clip_position();
#ifdef ALPHA_MASK
    v_alpha = in_color.a;
#ifdef CLUSTERED
    v_material = in_material;
#else
    v_alpha *= u_base_color.a;
#endif
#ifdef TEXTURED
    v_texture_coordinate = in_texture_coordinate;
#endif
#endif
}
