// Light of an environment map.
// vec3 ambient_light(vec3 normal): light on a white surface, by spherical harmonics of order 2.
// vec3 environment_light(vec3 direction, float roughness): radiance, filtered for a roughness.
// Directions are unit vectors in world axes; radiance is linear RGB.
// Twin of omnisim/scene/light/environment.py.
// Source: Ramamoorthi and Hanrahan, "An efficient representation for irradiance environment maps",
// 2001; Karis, "Real shading in Unreal Engine 4", 2013.

uniform vec3 u_irradiance[9];
uniform sampler2D u_filtered_sky;  // one level per roughness step

#include "scene/sky_coordinates.glsl"

vec3 ambient_light(vec3 n) {
    vec3 total = u_irradiance[0]
        + u_irradiance[1] * n.y + u_irradiance[2] * n.z + u_irradiance[3] * n.x
        + u_irradiance[4] * (n.x * n.y) + u_irradiance[5] * (n.y * n.z)
        + u_irradiance[6] * (3.0 * n.z * n.z - 1.0) + u_irradiance[7] * (n.x * n.z)
        + u_irradiance[8] * (n.x * n.x - n.y * n.y);
    return u_ambient + max(total, 0.0);
}

vec3 environment_light(vec3 direction, float roughness) {
    float level = roughness * float(textureQueryLevels(u_filtered_sky) - 1);
    return u_ambient + textureLod(u_filtered_sky, sky_coordinates(direction), level).rgb;
}
