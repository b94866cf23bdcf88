// vec3 fogged(vec3 color, float distance_m): a linear color seen through this much fog, with FOG.
// Twin of omnisim/rendering/rays/shading/fog.py.

#ifdef FOG
uniform vec3 u_fog_color;              // linear RGB at an infinite distance
uniform vec3 u_fog_attenuation_per_m;  // of R, G and B

vec3 fogged(vec3 color, float distance_m) {
    return mix(u_fog_color, color, exp(-u_fog_attenuation_per_m * distance_m));
}
#else
vec3 fogged(vec3 color, float distance_m) {
    return color;
}
#endif
