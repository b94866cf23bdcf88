// vec3 lit_color(vec3 base_color, vec3 triangle_normal): linear RGB from a surface toward the
//     viewpoint.
// GLASS: the surface is that of a body of thick glass, see scene/glass.glsl.
// PANE: the surface is a thin pane; vec3 transmittance(...) is that of scene/pane.glsl.
// REFLECTANCE: the surface has metal, gloss, maps or emission. LIGHTMAP without LIT: the surface is
// matte, and the lightmap contains all of its light. Neither LIT nor LIGHTMAP: the result is the
// base color; light is computed at the vertices, or ignored.

#if defined(LIT) && defined(REFLECTANCE)
#include "scene/lighting.glsl"
#include "scene/reflectance.glsl"
#include "scene/reflective_material.glsl"
#ifdef PANE
#include "scene/pane.glsl"
#endif
#ifdef GLASS
#include "scene/glass.glsl"
#endif

vec3 lit_color(vec3 base_color, vec3 triangle_normal) {
    vec2 uv = texture_coordinate();
    vec3 position = surface_position(), plain_normal = seen_normal(triangle_normal);
    float side = gl_FrontFacing ? 1.0 : -1.0;
    vec3 normal = shading_normal(plain_normal, position, uv, side);
    vec3 coat_normal = coat_shading_normal(plain_normal, position, uv, side);
    Reflectance surface = reflectance_of(base_color, uv);
#ifdef PANE
    make_pane(surface, base_color, position, normal, triangle_normal);
#endif
    vec3 light = vec3(0.0);
#ifdef GLASS
    light = glass_light(base_color, position, normal, normalize(-position));
    make_glass(surface, abs(dot(normal, normalize(-position))));
#endif
    return light + reflected_light(
        surface, position, normal, coat_normal, plain_normal, normalize(-position));
}
#elif defined(LIT)
#include "scene/lighting.glsl"

vec3 lit_color(vec3 base_color, vec3 triangle_normal) {
    vec3 light = light_on_surface(surface_position(), seen_normal(triangle_normal));
    return base_color * (is_unlit() ? vec3(1.0) : light);
}
#elif defined(LIGHTMAP)
#include "scene/baked_light.glsl"

vec3 lit_color(vec3 base_color, vec3 triangle_normal) {
    return is_unlit() ? base_color : base_color * lightmap_light();
}
#else
vec3 lit_color(vec3 base_color, vec3 triangle_normal) {
    return base_color;
}
#endif
