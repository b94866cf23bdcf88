// A surface of the scene: linear base color, lit or not. Colors are linear throughout; the
// texture is stored as sRGB and decoded by the sampler.
// With REFLECTANCE it has metal, gloss, maps or emission; TEXTURE_COORDINATES: one of the maps counts.
// With NORMALS_AGREE all normals point to the front side, which alone is seen: none is missing, and
// none is flipped. POSITION: the position counts, for punctual lights, missing normals,
// shadows, probes or FOG.
// With LIGHTMAP and without LIT it is matte, and all of its light is in the lightmap.
#version 450 core

#include "scene/material.glsl"

#if defined(TEXTURED) || defined(TEXTURE_COORDINATES)
in vec2 v_texture_coordinate;
#endif
#ifdef BAKED
flat
#endif
in vec4 v_color;  // base color, and light where that is known
layout(location = 0) out vec4 out_color;

#ifdef POSITION
in vec3 v_position;
#endif
#ifdef FOG
#include "scene/fog.glsl"
#endif
#if defined(LIGHTMAP) && !defined(LIT)
#include "scene/baked_light.glsl"
#endif
#ifdef LIT
in vec3 v_normal;
#include "scene/lighting.glsl"
#ifdef REFLECTANCE
#include "scene/reflectance.glsl"
#include "scene/reflective_material.glsl"
#endif
#endif

void main() {
    vec4 color = v_color;
#ifdef TEXTURED
    color *= texture_color(v_texture_coordinate);
#endif
#if defined(LIT) && !defined(NORMALS_AGREE)
    // before any discard: derivatives need the whole 2 x 2 block
    vec3 flat_normal = cross(dFdx(v_position), dFdy(v_position));
#endif
#ifdef BLENDED_ARRAYS
    if (!gl_FrontFacing && (MATERIAL_KIND & DOUBLE_SIDED_BIT) == 0) discard;
#endif
#ifdef ALPHA_MASK
    bool is_hole = color.a < ALPHA_CUTOFF;
#if !defined(REFLECTANCE) && !defined(SHADOWS)
    if (is_hole) discard;  // not yet where maps are sampled, which needs derivatives, too
#endif
#endif
#ifdef LIT
    vec3 normal = v_normal;
#ifndef NORMALS_AGREE
    // The side that is seen is the side that is lit, whatever way the triangle is wound.
    flat_normal *= dot(flat_normal, v_position) > 0.0 ? -1.0 : 1.0;
    normal = dot(v_normal, v_normal) > 0.0 ? v_normal : flat_normal;
    normal *= dot(normal, flat_normal) < 0.0 ? -1.0 : 1.0;
#endif
#ifdef POSITION
    vec3 position = v_position;
#else
    vec3 position = vec3(0.0);  // unused
#endif
    normal *= inversesqrt(max(dot(normal, normal), 1e-37));  // 0 on a triangle seen edge-on
#ifdef REFLECTANCE
#ifdef TEXTURE_COORDINATES
    vec2 uv = v_texture_coordinate;
#else
    vec2 uv = vec2(0.0);  // unused
#endif
    vec3 plain_normal = normal;
    float side = gl_FrontFacing ? 1.0 : -1.0;
    normal = shading_normal(plain_normal, position, uv, side);
    vec3 coat_normal = coat_shading_normal(plain_normal, position, uv, side);
    color.rgb = reflected_light(
        reflectance_of(color.rgb, uv), position, normal, coat_normal, plain_normal,
        normalize(-position));
#else
    vec3 light = light_on_surface(position, normal);
#ifdef BLENDED_ARRAYS
    if ((MATERIAL_KIND & UNLIT_BIT) != 0) light = vec3(1.0);
#endif
    color.rgb *= light;
#endif
#endif
#if defined(LIGHTMAP) && !defined(LIT)
#ifdef BLENDED_ARRAYS
    if ((MATERIAL_KIND & UNLIT_BIT) == 0)
#endif
    color.rgb *= lightmap_light();
#endif
#if defined(ALPHA_MASK) && (defined(REFLECTANCE) || defined(SHADOWS))
    if (is_hole) discard;
#endif
#ifdef FOG
    color.rgb = fogged(color.rgb, length(v_position));
#endif
#ifndef ALPHA_BLEND
    color.a = 1.0;
#endif
    // the largest half float: near a punctual light there is no bound, and infinity spoils mip levels
    out_color = vec4(min(color.rgb, vec3(65504.0)), color.a);
}
