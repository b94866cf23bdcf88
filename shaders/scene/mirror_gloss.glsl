// Rough lobes of planar mirrors, by sampled facets.
// vec3 sampled_gloss(…), with the arguments of mirrored_gloss in scene/planar_mirror.glsl.
// A planar mirror is a window to a mirrored scene. Each facet's ray into that scene ends as far
// from the surface as a perfect mirror's ray, and takes the light of the mirrored view there. Rays
// that leave the view take the mean of the others' light, or a perfect mirror's.
// Twin of omnisim/rendering/rays/shading/ray_optics.py, which has the sources.

#include "capture/tiles.glsl"
#include "common/random.glsl"

uniform mat3 u_rig_from_world;
uniform vec2 u_atlas_px;
const int FACETS = 4;
const float FARTHEST_M = 1e4;
const vec2 R2_STEPS = vec2(0.7548776662466927, 0.5698402909980532);

// Texel of the mirrored view in a direction from the viewpoint; false: it shows another mirror.
bool find_mirrored(uint mirror, vec3 direction, out vec4 texel) {
    vec3 rig = u_rig_from_world * direction;
    int face = face_of(rig);
    vec3 local = u_face_from_rig[face] * rig;
    vec2 tangent = local.xy / max(local.z, MIN_DEPTH);
    int tile = tile_of(face, tangent);
    vec4 limits = u_tile_padded_region[tile];
    vec2 uv = u_uv_from_tangent[tile].xy
        + clamp(tangent, limits.xy, limits.zw) * u_uv_from_tangent[tile].zw;
    ivec2 at = ivec2(uv * u_atlas_px);
    texel = texelFetch(u_mirrored, at, 0);
    return texelFetch(u_mirror_owners, at, 0).r == mirror;
}

// Facet normal, sampled in proportion to its area visible from the view direction.
vec3 visible_facet(vec3 normal, vec3 view, float alpha, vec2 numbers) {
    float height = max(dot(normal, view), MIN_COSINE);
    vec3 stretched = normalize(alpha * (view - dot(view, normal) * normal) + height * normal);
    vec3 helper = abs(normal.x) < 0.7 ? vec3(1.0, 0.0, 0.0) : vec3(0.0, 1.0, 0.0);
    vec3 side = cross(stretched, normal);
    side = normalize(length(side) < 1e-6 ? cross(helper, normal) : side);
    vec3 up = cross(stretched, side);
    if (dot(up, normal) < 0.0) up = -up;
    float radius = sqrt(numbers.x), azimuth = 2.0 * PI * numbers.y;
    float x = radius * cos(azimuth), y = radius * sin(azimuth);
    float share = 0.5 * (1.0 + dot(stretched, normal));
    y = mix(sqrt(max(1.0 - x * x, 0.0)), y, share);
    float depth = sqrt(max(1.0 - x * x - y * y, 0.0));
    vec3 facet = x * side + y * up + depth * stretched;
    float along = dot(facet, normal);
    return normalize(alpha * (facet - along * normal) + max(along, 0.0) * normal);
}

// Share of a visible facet's light that other facets do not shadow.
float unshadowed(float light, float view, float squared) {
    float root = sqrt(view * view * (1.0 - squared) + squared);
    float other = view * sqrt(light * light * (1.0 - squared) + squared);
    return light * (view + root) / max(light * root + other, 1e-7);
}

vec3 sampled_gloss(
    uint mirror, ivec2 at, vec3 position, vec3 normal, vec3 view, float roughness, vec3 f0,
    float f90) {
    vec3 plane = u_mirror_planes[mirror - 1u].xyz;
    float alpha = roughness * roughness;
    uvec4 hashes = pcg4d(uvec4(uvec2(gl_FragCoord.xy), mirror, 0u));
    vec2 start = vec2(uniform_number(hashes.x), uniform_number(hashes.y));
    vec4 straight = texelFetch(u_mirrored, at, 0);
    float path_m = max((straight.a < 0.0 ? -straight.a : FARTHEST_M) - length(position), 0.0);
    vec3 total = vec3(0.0), seen = vec3(0.0), all = vec3(0.0);
    for (int number = 0; number < FACETS; ++number) {
        vec3 facet = visible_facet(normal, view, alpha, fract(start + float(number) * R2_STEPS));
        float along = dot(view, facet);
        vec3 direction = 2.0 * along * facet - view;
        float light = dot(direction, normal);
        if (light <= 0.0) continue;
        float grazing = pow(1.0 - clamp(along, 0.0, 1.0), 5.0);
        float share = unshadowed(light, max(dot(normal, view), MIN_COSINE), alpha * alpha);
        vec3 weight = share * mix(f0, vec3(f90), grazing);
        all += weight;
        direction -= 2.0 * dot(direction, plane) * plane;
        vec4 texel;
        if (!find_mirrored(mirror, position + path_m * direction, texel)) continue;
        total += weight * texel.rgb;
        seen += weight;
    }
    vec3 radiance = seen.g > 0.0 ? total / max(seen, 1e-9) : straight.rgb;
    return radiance * all / float(FACETS);
}
