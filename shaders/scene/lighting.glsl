// vec3 light_on_surface(vec3 position, vec3 normal): light on a white surface, linear RGB.
// Lamp directional_lamp(int i, vec3 position), punctual_lamp(int i, vec3 position, vec3 area):
//     light i at a surface, for any reflectance; area: surface_area(position), see
//     scene/shadow.glsl.
// vec3 ambient_light(vec3 normal): light of the environment on a white surface.
// vec3 environment_light(vec3 direction, float roughness): radiance of the environment around a
//     direction, as a surface of this roughness reflects it.
// vec3 with_lamps(vec3 light, vec3 position, vec3 normal): light plus that of all lamps on a white
//     surface.
// position: meters from the effective viewpoint; normal: unit vector; both in world axes.
// With BAKED_LIGHT, set by LIGHTMAP or PROBES, light_on_surface is that of scene/baked_light.glsl.
// DIRECTIONAL_LIGHTS, PUNCTUAL_LIGHTS: numbers of directional, and of point and spot lights.
// EACH_DIRECTIONAL, EACH_PUNCTUAL: expand a macro once per light. A loop with a large body might
// not be unrolled, which would hide the light's constants from the compiler. A point light is a
// spot light whose cone covers every direction.
// Twin of the illuminance in omnisim/scene/light/lighting.py.
// Source: glTF extension KHR_lights_punctual (falloff and cone).

uniform vec3 u_ambient;
#if DIRECTIONAL_LIGHTS > 0
uniform vec3 u_directional_color[DIRECTIONAL_LIGHTS];      // color × intensity × exposure
uniform vec3 u_directional_direction[DIRECTIONAL_LIGHTS];  // unit direction of travel
#endif
#ifdef LAYERED
flat in int v_camera;
#endif
#include "scene/light_positions.glsl"
#if PUNCTUAL_LIGHTS > 0
uniform vec3 u_punctual_color[PUNCTUAL_LIGHTS];  // color × intensity × exposure
uniform vec3 u_punctual_direction[PUNCTUAL_LIGHTS];  // unit direction of travel
uniform vec3 u_punctual_limits[PUNCTUAL_LIGHTS];  // range in meters, cosines of the two cones
#endif

#include "scene/shadow.glsl"

#ifdef ENVIRONMENT
#include "scene/environment.glsl"
#else
vec3 ambient_light(vec3 normal) {
    return u_ambient;
}

vec3 environment_light(vec3 direction, float roughness) {
    return u_ambient;
}
#endif

struct Lamp {
    vec3 color;
    float level;     // factor of the color on a surface that faces the lamp
    vec3 direction;  // unit vector toward the lamp
};

#if DIRECTIONAL_LIGHTS > 0
Lamp directional_lamp(int i, vec3 position) {
    float level = directional_visibility(i, position);
    return Lamp(u_directional_color[i], level, -u_directional_direction[i]);
}
#endif
#if PUNCTUAL_LIGHTS > 0
Lamp punctual_lamp(int i, vec3 position, vec3 area) {
    vec3 away = position - PUNCTUAL_POSITION(i);
    float distance_m = max(length(away), 1e-3);
    away /= distance_m;
    float share = distance_m / u_punctual_limits[i].x;
    share *= share;
    float level = clamp(1.0 - share * share, 0.0, 1.0) / (distance_m * distance_m);
    float inside = (dot(away, u_punctual_direction[i]) - u_punctual_limits[i].z)
        / max(u_punctual_limits[i].y - u_punctual_limits[i].z, 1e-3);
    float cone = clamp(inside, 0.0, 1.0);
    float visibility = punctual_visibility(i, distance_m * away, area);
    return Lamp(u_punctual_color[i], level * cone * cone * visibility, -away);
}
#endif

vec3 illuminance(Lamp lamp, vec3 normal) {
    return lamp.color * (lamp.level * max(dot(normal, lamp.direction), 0.0));
}

vec3 with_lamps(vec3 light, vec3 position, vec3 normal) {
    vec3 total = light, area = surface_area(position);
#if DIRECTIONAL_LIGHTS > 0
#define ADD_DIRECTIONAL(i) total += illuminance(directional_lamp(i, position), normal);
    EACH_DIRECTIONAL(ADD_DIRECTIONAL)
#endif
#if PUNCTUAL_LIGHTS > 0
#define ADD_PUNCTUAL(i) total += illuminance(punctual_lamp(i, position, area), normal);
    EACH_PUNCTUAL(ADD_PUNCTUAL)
#endif
    return total;
}

#ifdef BAKED_LIGHT
#include "scene/baked_light.glsl"

vec3 light_on_surface(vec3 position, vec3 normal) {
    return baked_light(position, normal);
}
#else
vec3 light_on_surface(vec3 position, vec3 normal) {
    return with_lamps(ambient_light(normal), position, normal);
}
#endif
