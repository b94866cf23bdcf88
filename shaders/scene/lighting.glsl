// vec3 light_on_surface(vec3 position, vec3 normal): what a white surface shows, linear RGB.
// position in metres from the effective viewpoint, normal a unit vector, both in axes of the
// world. Twin of the illuminance in omnisim/scene/punctual_lights.py.
// Source: glTF extension KHR_lights_punctual (falloff and cone).

const int MAX_LIGHTS = 32;
const int DIRECTIONAL = 0, POINT = 1, SPOT = 2;

uniform vec3 u_ambient;
uniform int u_light_count;
uniform int u_light_kind[MAX_LIGHTS];
uniform vec3 u_light_color[MAX_LIGHTS];      // intensity and exposure multiplied in
uniform vec3 u_light_position[MAX_LIGHTS];   // metres from the effective viewpoint
uniform vec3 u_light_direction[MAX_LIGHTS];  // unit, the way the light travels
uniform vec3 u_light_limits[MAX_LIGHTS];     // range in metres, cosine of inner and outer cone

vec3 light_on_surface(vec3 position, vec3 normal) {
    vec3 total = u_ambient;
    for (int i = 0; i < u_light_count; ++i) {
        vec3 travel = u_light_direction[i];
        float level = 1.0;
        if (u_light_kind[i] != DIRECTIONAL) {
            vec3 away = position - u_light_position[i];
            float distance_m = max(length(away), 1e-3);
            away /= distance_m;
            level = clamp(1.0 - pow(distance_m / u_light_limits[i].x, 4.0), 0.0, 1.0)
                / (distance_m * distance_m);
            if (u_light_kind[i] == SPOT) {
                float inside = (dot(away, travel) - u_light_limits[i].z)
                    / max(u_light_limits[i].y - u_light_limits[i].z, 1e-3);
                float cone = clamp(inside, 0.0, 1.0);
                level *= cone * cone;
            }
            travel = away;
        }
        total += u_light_color[i] * (level * max(dot(normal, -travel), 0.0));
    }
    return total;
}
