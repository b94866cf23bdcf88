// Light of a reflection probe: a cube of light and distances from a viewpoint near a surface.
// vec3 reflected_probe(vec3 position, vec3 direction, float roughness, float spread): light, linear
//     RGB, from a direction around a surface. position: meters from the viewpoint; direction: unit
//     vector in world axes; spread: angle between the directions of adjacent texels, in radians.
// float reflected_spread(vec3 normal, vec3 view): spread of reflected directions. Call it before
//     any branch.
// A reflected ray is followed to where the probe's distances say that it hits the scene. Rough
// lobes take a filtered level, the sharper the nearer the hit.
// The levels are those of omnisim/rendering/opengl/reflect/probe_pass.py.
// Source: Szirmay-Kalos, Aszódi, Lazányi and Premecz, "Approximate ray-tracing on the GPU with
// distance impostors", 2005.

// light; alpha: 1 / distance in meters. The unit is that of surface_program.py: moderngl cannot set
// samplers of this type.
layout(binding = 18) uniform samplerCubeArray u_reflection_probes;
uniform vec4 u_probe;  // center of the probe, in meters from the viewpoint; index of its cube

const float FIRST_ALPHA = 0.024;    // squared roughness of level 1; it doubles from level to level
const float MIN_PER_M = 1e-4;       // 1 / distance of the sky
const float SPREAD_SHARE = 0.35;    // filter of a level, relative to its squared roughness
const float SKY_M = 1e4;
const float SAME_SHARE = 0.1;  // tolerance of a hit's distance from the center
const float MIN_BLURRED = 0.2;  // roughness from which hits may be less precise
uniform ivec2 u_probe_steps;  // toward a hit, and refinements of it

float reflected_spread(vec3 normal, vec3 view) {
    vec3 direction = reflect(-view, normal);
    return max(length(dFdx(direction)), length(dFdy(direction)));
}

float per_m(vec3 direction, float level) {
    return max(textureLod(u_reflection_probes, vec4(direction, u_probe.w), level).a, MIN_PER_M);
}

float level_of(float alpha) {
    return alpha < FIRST_ALPHA ? alpha / FIRST_ALPHA : 1.0 + log2(alpha / FIRST_ALPHA);
}

// Distance along a ray from the probe's center to the sphere that its next surface is on.
float reach_m(float along, float squared, float distance_per_m) {
    float radius = 1.0 / distance_per_m;
    return max(sqrt(max(along * along - squared + radius * radius, 0.0)) - along, 0.0);
}

// Distance in meters along a ray from a point relative to the probe's center. The hit is bracketed
// by points at equal angles around the center, then refined. Rays that pass behind a surface have
// no hit there; they end at what is seen in their own direction.
float hit_m(vec3 start, vec3 direction, int steps, float level) {
    float along = dot(start, direction), squared = dot(start, start);
    float height = sqrt(max(squared - along * along, 0.0));  // the center's, above the ray
    float first = atan(along, height);
    float before = 0.0, after = 0.0;
    for (int i = 1; i <= steps; ++i) {
        before = after;
        float angle = mix(first, 0.5 * PI, float(i) / float(steps));
        after = i < steps ? height * tan(angle) - along : SKY_M;
        vec3 at = start + after * direction;
        if (i == steps || length(at) * per_m(at, level) >= 1.0) break;  // behind a surface
    }
    float range = after, off = 0.0;
    for (int i = 0; i < u_probe_steps.y; ++i) {
        vec3 at = start + range * direction;
        float at_per_m = per_m(at, level);
        off = length(at) * at_per_m - 1.0;
        range = clamp(reach_m(along, squared, at_per_m), before, after);
    }
    if (abs(off) < SAME_SHARE || steps == 1) return range;
    range = SKY_M;
    for (int i = 0; i <= u_probe_steps.y; ++i)
        range = reach_m(along, squared, per_m(start + range * direction, level));
    return range;
}

vec3 reflected_probe(vec3 position, vec3 direction, float roughness, float spread) {
    vec3 start = position - u_probe.xyz;
    bool is_sharp = roughness < MIN_BLURRED;
    float level = is_sharp ? 0.0 : level_of(roughness * roughness);
    float range = hit_m(start, direction, is_sharp ? u_probe_steps.x : 1, level);
    vec3 hit = start + range * direction;
    float size = float(textureSize(u_reflection_probes, 0).x);
    float texel = 0.5 * PI / size;
    float alpha = roughness * roughness * min(range / max(length(hit), 1e-6), 1.0);
    float filtered = SPREAD_SHARE * FIRST_ALPHA * max(spread / texel - 1.0, 0.0);
    alpha = sqrt(alpha * alpha + filtered * filtered);
    return textureLod(u_reflection_probes, vec4(hit, u_probe.w), level_of(alpha)).rgb;
}
