// Reflectance of metals and dielectrics.
// struct Reflectance: reflectance of a fragment's surface.
// vec3 reflected_light(Reflectance surface, vec3 position, vec3 normal, vec3 coat_normal,
//     vec3 shape_normal, vec3 view): linear RGB that a lit surface reflects and emits. Vectors are
//     in world axes; view is a unit vector toward the viewpoint. normal and coat_normal are after
//     normal mapping, shape_normal is before it.
// With BAKED_LIGHT, the light of the surroundings is the baked light minus that of the lamps. The
// reflection of an environment map is then scaled by the share of its light that reaches the
// surface.
// With REFLECTION_PROBE, gloss and coats reflect the probe of scene/reflection_probe.glsl.
// With PLANAR_MIRRORS, smooth gloss and coats reflect the views of scene/planar_mirror.glsl.
// Twin of omnisim/rendering/rays/shading/lit_surfaces.py. Includes scene/lighting.glsl.
// Source: glTF 2.0, appendix B; KHR_materials_specular, KHR_materials_clearcoat; for baked light
// beside maps: Lazarov, "Getting more physical in Call of Duty: Black Ops II", 2013.

const float PI = 3.14159265358979;
// omnisim/scene/surface_reflectance.py
const float MIN_ROUGHNESS = 0.04, MAX_TRACED_ROUGHNESS = 0.5;
const float COAT_F0 = 0.04;
const float MIN_COSINE = 1e-3;
const float ABOVE = 1e-3;  // omnisim/rendering/rays/shading/ray_optics.py

struct Reflectance {
    vec3 body;          // light scattered below the surface of a dielectric
    vec3 dielectric_f0;
    vec3 f0;            // mean of dielectric and metal, weighted by metalness
    float dielectric_f90;
    float f90;
    float roughness;
    float coat;
    float coat_roughness;
    float occlusion;    // factor of environment light
    vec3 emissive;
};

uniform sampler2D u_environment_table;  // omnisim/scene/surface_reflectance.py

vec3 environment_shares(float cosine, float roughness) {
    vec2 size = vec2(textureSize(u_environment_table, 0));
    return textureLod(
        u_environment_table, (vec2(cosine, roughness) * (size - 1.0) + 0.5) / size, 0.0).rgb;
}

float largest(vec3 color) {
    return max(color.r, max(color.g, color.b));
}

// Microfacet distribution times visibility times PI.
float microfacets(float roughness, vec3 normal, vec3 halfway, float light, float view) {
    float alpha = roughness * roughness, squared = alpha * alpha;
    vec3 across = cross(normal, halfway);
    float height = dot(normal, halfway);
    float spread = dot(across, across) + height * height * squared;
    float visible = light * sqrt(view * view * (1.0 - squared) + squared)
        + view * sqrt(light * light * (1.0 - squared) + squared);
    return 0.5 * squared / max(spread * spread * visible, 1e-12);
}

vec3 reflected_lamp(
    Reflectance surface, Lamp lamp, vec3 normal, vec3 coat_normal, vec3 view, float coat) {
    float light = max(dot(normal, lamp.direction), 0.0);
    float view_cosine = clamp(abs(dot(normal, view)), MIN_COSINE, 1.0);
    vec3 middle = lamp.direction + view;  // 0 if the lamp is exactly opposite to the view
    vec3 halfway = middle * inversesqrt(max(dot(middle, middle), 1e-30));
    float grazing = pow(1.0 - clamp(dot(view, halfway), 0.0, 1.0), 5.0);
    vec3 gloss = mix(surface.f0, vec3(surface.f90), grazing)
        * microfacets(surface.roughness, normal, halfway, light, view_cosine);
    float lost = largest(mix(surface.dielectric_f0, vec3(surface.dielectric_f90), grazing));
    vec3 total = light * (1.0 - coat) * (surface.body * (1.0 - lost) + gloss);
    if (coat > 0.0) {
        float coat_light = max(dot(coat_normal, lamp.direction), 0.0);
        float coat_view = clamp(abs(dot(coat_normal, view)), MIN_COSINE, 1.0);
        total += coat * coat_light
            * microfacets(surface.coat_roughness, coat_normal, halfway, coat_light, coat_view);
    }
    return lamp.color * lamp.level * total;
}

// Dominant direction of reflected light: the rougher the surface, the nearer to the normal.
// It is above the surface, whatever a normal map says.
// Source: Lagarde and de Rousiers, "Moving Frostbite to PBR", 2014, listing 22.
vec3 dominant_direction(vec3 normal, vec3 shape_normal, vec3 view, float roughness) {
    float alpha = roughness * roughness;
    float share = (1.0 - alpha) * (sqrt(1.0 - alpha) + alpha);
#if defined(NORMAL_MAP) || defined(CLEARCOAT_NORMAL_MAP)
    vec3 facing = view - 2.0 * min(dot(normal, view), 0.0) * normal;
    vec3 direction = normalize(mix(normal, reflect(-facing, normal), share));
    float below = max(ABOVE - dot(direction, shape_normal), 0.0);
    return normalize(direction + below * shape_normal);
#else
    return normalize(mix(normal, reflect(-view, normal), share));
#endif
}

// Radiance around a direction, given the surroundings' light on a white surface.
vec3 surroundings(vec3 direction, float roughness, vec3 normal, vec3 light) {
#if defined(BAKED_LIGHT) && defined(ENVIRONMENT)
    vec3 share = clamp(light / max(ambient_light(normal), 1e-4), 0.0, 1.0);
    return share * environment_light(direction, roughness);
#elif defined(BAKED_LIGHT)
    return light;
#else
    return environment_light(direction, roughness);
#endif
}

#ifdef REFLECTION_PROBE
#include "scene/reflection_probe.glsl"

vec3 reflected_surroundings(
    vec3 position, vec3 direction, float roughness, float spread, vec3 normal, vec3 light) {
    if (roughness > MAX_TRACED_ROUGHNESS) return surroundings(direction, roughness, normal, light);
    return reflected_probe(position, direction, roughness, spread);
}
#else
float reflected_spread(vec3 normal, vec3 view) {
    return 0.0;
}

vec3 reflected_surroundings(
    vec3 position, vec3 direction, float roughness, float spread, vec3 normal, vec3 light) {
    return surroundings(direction, roughness, normal, light);
}
#endif

// Light of the surroundings on a white surface; shape_normal: normal before normal mapping.
vec3 light_of_surroundings(vec3 position, vec3 normal, vec3 shape_normal) {
#ifdef BAKED_LIGHT
    vec3 lamps = with_lamps(vec3(0.0), position, shape_normal);
    return max(baked_light(position, shape_normal) - lamps, 0.0);
#else
    return ambient_light(normal);
#endif
}

#ifdef PLANAR_MIRRORS
#include "scene/planar_mirror.glsl"
#endif

vec3 reflected_environment(
    Reflectance surface, vec3 position, vec3 normal, vec3 coat_normal, vec3 shape_normal, vec3 view,
    float coat, vec3 light) {
    float spread = reflected_spread(normal, view);
    float coat_spread = reflected_spread(coat_normal, view);
    float cosine = clamp(abs(dot(normal, view)), MIN_COSINE, 1.0);
    vec3 shares = environment_shares(cosine, surface.roughness);
    float lost = largest(mix(surface.dielectric_f0, vec3(surface.dielectric_f90), shares.z));
    vec3 total = surface.body * (1.0 - lost) * light
        + (surface.f0 * shares.x + surface.f90 * shares.y)
            * reflected_surroundings(
                position, dominant_direction(normal, shape_normal, view, surface.roughness),
                surface.roughness, spread, normal, light);
#ifdef PLANAR_MIRRORS
    ivec2 at;
    uint mirror = mirror_at(position, at);
    if (mirror != 0u && surface.roughness <= MAX_TRACED_ROUGHNESS)
        total = surface.body * (1.0 - lost) * light
            + mirrored_gloss(
                mirror, at, position, normal, view, surface.roughness, surface.f0, surface.f90);
#endif
    total *= 1.0 - coat;
#ifdef PLANAR_MIRRORS
    if (mirror != 0u && surface.coat_roughness <= MAX_TRACED_ROUGHNESS) {
        vec3 coated = vec3(0.0);
        if (coat > 0.0)
            coated = coat * mirrored_gloss(
                mirror, at, position, coat_normal, view, surface.coat_roughness, vec3(1.0), 1.0);
        return surface.occlusion * (total + coated);
    }
#endif
    if (coat > 0.0) {
        vec2 coated = environment_shares(
            clamp(abs(dot(coat_normal, view)), MIN_COSINE, 1.0), surface.coat_roughness).xy;
        total += coat * (coated.x + coated.y)
            * reflected_surroundings(
                position,
                dominant_direction(coat_normal, shape_normal, view, surface.coat_roughness),
                surface.coat_roughness, coat_spread, coat_normal, light);
    }
    return surface.occlusion * total;
}

// A lamp behind a surface does not light it, whatever its normal map says.
#if defined(NORMAL_MAP) || defined(CLEARCOAT_NORMAL_MAP)
Lamp faced_lamp(Lamp lamp, vec3 shape_normal) {
    if (dot(shape_normal, lamp.direction) <= 0.0) lamp.level = 0.0;
    return lamp;
}
#define FACED(lamp) faced_lamp(lamp, shape_normal)
#else
#define FACED(lamp) lamp
#endif

#ifdef IN_MIRROR
uniform float u_mirror_spread;  // slope of the mirror's facets; 0: it is smooth

// Highlights as wide as the cone in which a rough mirror sees them: few of its facets would meet
// narrow ones. Twin of halfway_spreads in omnisim/rendering/rays/shading/ray_optics.py.
void widen_highlights(inout Reflectance surface, vec3 position, vec3 shape_normal) {
    float right = length(dFdx(shape_normal)) / max(length(dFdx(position)), 1e-9);
    float down = length(dFdy(shape_normal)) / max(length(dFdy(position)), 1e-9);
    if (u_mirror_spread == 0.0) return;
    float spread = u_mirror_spread * (1.0 + 2.0 * max(right, down) * range_beyond_mirror(position));
    vec2 squared = pow(vec2(surface.roughness, surface.coat_roughness), vec2(4.0));
    vec2 wider = min(sqrt(sqrt(squared + spread * spread)), 1.0);
    surface.roughness = wider.x;
    surface.coat_roughness = wider.y;
}
#endif

vec3 reflected_light(
    Reflectance surface, vec3 position, vec3 normal, vec3 coat_normal, vec3 shape_normal,
    vec3 view) {
    float coat_cosine = clamp(abs(dot(coat_normal, view)), MIN_COSINE, 1.0);
    float coat = surface.coat * mix(COAT_F0, 1.0, pow(1.0 - coat_cosine, 5.0));
    vec3 light = light_of_surroundings(position, normal, shape_normal);
    vec3 total = (1.0 - coat) * surface.emissive
        + reflected_environment(
            surface, position, normal, coat_normal, shape_normal, view, coat, light);
    vec3 area = surface_area(position);
#ifdef IN_MIRROR
    widen_highlights(surface, position, shape_normal);
#endif
#define REFLECT(lamp) \
    total += reflected_lamp(surface, FACED(lamp), normal, coat_normal, view, coat);
#if DIRECTIONAL_LIGHTS > 0
#define REFLECT_DIRECTIONAL(i) REFLECT(directional_lamp(i, position))
    EACH_DIRECTIONAL(REFLECT_DIRECTIONAL)
#endif
#if PUNCTUAL_LIGHTS > 0
#define REFLECT_PUNCTUAL(i) REFLECT(punctual_lamp(i, position, area))
    EACH_PUNCTUAL(REFLECT_PUNCTUAL)
#endif
    return total;
}
