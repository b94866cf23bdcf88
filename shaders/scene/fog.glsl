// vec3 fogged(vec3 color, float distance_m): linear color seen through fog over a distance; without
// FOG, the color itself.
// float fog_range(vec3 position): distance of a surface, in meters, through the fog between it and
//     the viewpoint; with IN_MIRROR between it and the mirror, since the mirror has its own fog.
// Twin of omnisim/rendering/rays/ray_scene.py.

#ifdef FOG
uniform vec3 u_fog_color;              // linear RGB at infinite distance
uniform vec3 u_fog_attenuation_per_m;  // attenuation of R, G and B

vec3 fogged(vec3 color, float distance_m) {
    return mix(u_fog_color, color, exp(-u_fog_attenuation_per_m * distance_m));
}
#else
vec3 fogged(vec3 color, float distance_m) {
    return color;
}
#endif

#ifdef IN_MIRROR
uniform vec4 u_mirror;  // as in scene/mirror_clip.glsl

float range_beyond_mirror(vec3 position) {
    float height_m = dot(u_mirror.xyz, position) + u_mirror.w;
    return length(position) * clamp(height_m / (height_m - u_mirror.w), 0.0, 1.0);
}
#endif
#if defined(FOG) && defined(IN_MIRROR)
float fog_range(vec3 position) {
    return range_beyond_mirror(position);
}
#else
float fog_range(vec3 position) {
    return length(position);
}
#endif
