// Vertex of the scene, see scene/vertex.glsl.
// u_viewpoint_from_mesh  axes of the world, origin at the effective viewpoint, meters
// u_normal_from_mesh  cofactors of the above: normals under any scale
// With BAKED in_light is the light on a white surface, linear RGB.
// u_light_rectangles  left, top, width and height of an item's sides in the lightmap; those of clusters
// are applied
#version 450 core

#include "scene/vertex.glsl"

layout(location = 3) in vec4 in_color;  // of clusters, times the base color
#ifdef BAKED
flat
#endif
out vec4 v_color;

#if defined(TEXTURED) || defined(TEXTURE_COORDINATES)
layout(location = 2) in vec2 in_texture_coordinate;
out vec2 v_texture_coordinate;
#endif
#ifdef BAKED
layout(location = 1) in vec3 in_light;
#endif
#ifdef BOTH_SIDES
#define SIDES 2
#define LIGHT_COORDINATE vec4
#else
#define SIDES 1
#define LIGHT_COORDINATE vec2
#endif
#ifdef LIGHTMAP
layout(location = 5) in LIGHT_COORDINATE in_light_coordinate;  // of the front, and of the back
out LIGHT_COORDINATE v_light_coordinate;
#endif
#ifdef LIT
layout(location = 1) in vec3 in_normal;
out vec3 v_normal;
#endif
#ifdef POSITION
out vec3 v_position;
#endif

#ifdef CLUSTERED
#if defined(TEXTURED) || defined(ALPHA_MASK) || defined(ALPHA_BLEND)
layout(location = 4) in vec2 in_material;
flat out vec2 v_material;  // layer of the texture array, and cutoff of alpha
#endif
#if defined(LIT) || defined(POSITION)
layout(location = 11) in mat3x4 in_viewpoint_from_object;  // its rows are columns here; rigid
#endif
#else
uniform vec4 u_base_color;
#ifdef POSITION
uniform mat4 u_viewpoint_from_mesh;
#endif
#ifdef LIT
uniform mat3 u_normal_from_mesh;
#endif
#ifdef LIGHTMAP
uniform vec4 u_light_rectangles[SIDES];
#endif
#endif

#ifdef REFLECTANCE
#include "scene/vertex_details.glsl"
#endif
#ifdef VERTEX_PLACES
#include "scene/light_positions.glsl"
#include "scene/shadow_places.glsl"
out vec3 v_places[PLACES];
#endif

void main() {
    gl_Position = clip_position();
#if defined(TEXTURED) || defined(TEXTURE_COORDINATES)
    v_texture_coordinate = in_texture_coordinate;
#endif
#ifdef CLUSTERED
    v_color = in_color;
#if defined(TEXTURED) || defined(ALPHA_MASK) || defined(ALPHA_BLEND)
    v_material = in_material;
#endif
#else
    v_color = u_base_color * in_color;
#endif
#ifdef BAKED
    v_color.rgb *= in_light;
#endif
#ifdef LIGHTMAP
#ifdef CLUSTERED
    v_light_coordinate = in_light_coordinate;
#else
    v_light_coordinate.xy = u_light_rectangles[0].xy
        + in_light_coordinate.xy * u_light_rectangles[0].zw;
#ifdef BOTH_SIDES
    v_light_coordinate.zw = u_light_rectangles[1].xy
        + in_light_coordinate.zw * u_light_rectangles[1].zw;
#endif
#endif
#endif
#ifdef POSITION
#ifdef CLUSTERED
    v_position = vec4(in_position, 1.0) * in_viewpoint_from_object;
#else
    v_position = (u_viewpoint_from_mesh * vec4(in_position, 1.0)).xyz;
#endif
#endif
#ifdef LIT
#ifdef CLUSTERED
    v_normal = vec4(in_normal, 0.0) * in_viewpoint_from_object;
#else
    v_normal = u_normal_from_mesh * in_normal;
#endif
#endif
#ifdef REFLECTANCE
    pass_details();
#endif
#ifdef VERTEX_PLACES
    for (int place = 0; place < PLACES; ++place) v_places[place] = place_on_map(place, v_position);
#endif
}
