// vec3 fogged(vec3 color, float distance_m): linear color seen through fog over a distance; without
// FOG, the color itself.
// Twin of omnisim/rendering/rays/shading/fog.py.

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
