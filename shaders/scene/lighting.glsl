// vec3 light_on_surface(vec3 position, vec3 normal): what a white surface shows, linear RGB.
// position in metres from the effective viewpoint, normal a unit vector, both in axes of the
// world. Twin of the illuminance in omnisim/scene/punctual_lights.py.
// SUNS, LAMPS: how many directional lights, and how many point and spot lights; known when this is
// compiled, so that the loops unroll and nothing branches. A point light is a spot light whose
// cone has every direction in it.
// Source: glTF extension KHR_lights_punctual (falloff and cone).

uniform vec3 u_ambient;
#if SUNS > 0
uniform vec3 u_sun_color[SUNS];      // intensity and exposure multiplied in
uniform vec3 u_sun_direction[SUNS];  // unit, the way the light travels
#endif
#if LAMPS > 0
uniform vec3 u_lamp_color[LAMPS];      // intensity and exposure multiplied in
uniform vec3 u_lamp_position[LAMPS];   // metres from the effective viewpoint
uniform vec3 u_lamp_direction[LAMPS];  // unit, the way the light travels
uniform vec3 u_lamp_limits[LAMPS];     // range in metres, cosine of inner and outer cone
#endif

vec3 light_on_surface(vec3 position, vec3 normal) {
    vec3 total = u_ambient;
#if SUNS > 0
    for (int i = 0; i < SUNS; ++i)
        total += u_sun_color[i] * max(dot(normal, -u_sun_direction[i]), 0.0);
#endif
#if LAMPS > 0
    for (int i = 0; i < LAMPS; ++i) {
        vec3 away = position - u_lamp_position[i];
        float distance_m = max(length(away), 1e-3);
        away /= distance_m;
        float share = distance_m / u_lamp_limits[i].x;
        share *= share;
        float level = clamp(1.0 - share * share, 0.0, 1.0) / (distance_m * distance_m);
        float inside = (dot(away, u_lamp_direction[i]) - u_lamp_limits[i].z)
            / max(u_lamp_limits[i].y - u_lamp_limits[i].z, 1e-3);
        float cone = clamp(inside, 0.0, 1.0);
        total += u_lamp_color[i] * (level * cone * cone * max(dot(normal, -away), 0.0));
    }
#endif
    return total;
}
