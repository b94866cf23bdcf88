// Vertex of the scene, for one tile.
// u_clip_from_mesh  pose and projection of the face, y of the clip space down the picture
// u_viewpoint_from_mesh  axes of the world, origin at the effective viewpoint, metres
// u_normal_from_mesh  cofactors of the above: normals under any scale
// With BAKED in_light is the light on a white surface, linear RGB.
#version 430 core

uniform mat4 u_clip_from_mesh;
uniform vec4 u_base_color;

in vec3 in_position;
in vec4 in_color;
#ifdef BAKED
flat
#endif
out vec4 v_color;

#ifdef TEXTURED
in vec2 in_texture_coordinate;
out vec2 v_texture_coordinate;
#endif
#ifdef BAKED
in vec3 in_light;
#endif
#ifdef LIT
uniform mat4 u_viewpoint_from_mesh;
uniform mat3 u_normal_from_mesh;
in vec3 in_normal;
out vec3 v_normal;
#ifdef POSITION
out vec3 v_position;
#endif
#endif

void main() {
    gl_Position = u_clip_from_mesh * vec4(in_position, 1.0);
#ifdef TEXTURED
    v_texture_coordinate = in_texture_coordinate;
#endif
    v_color = u_base_color * in_color;
#ifdef BAKED
    v_color.rgb *= in_light;
#endif
#ifdef LIT
#ifdef POSITION
    v_position = (u_viewpoint_from_mesh * vec4(in_position, 1.0)).xyz;
#endif
    v_normal = u_normal_from_mesh * in_normal;
#endif
}
