// bool ray_from_pixel(vec2 pixel_px, out vec3 ray): a measured lens, a monotone cubic through a
// table. The ray is a unit direction in the optical frame; false past the table's end.
// Twin of omnisim/cameras/models/radial_table.py. Source: Fritsch & Butland 1984, see there.

#include "camera/parts/polar.glsl"

const int NODES = 64;

uniform vec2 u_principal_point_px;
uniform float u_thetas_rad[NODES];  // increasing; the last angle pads the array
uniform float u_radii_px[NODES];
uniform float u_slopes_px[NODES];   // dr/dtheta

// left node of the current interval
int node_left = 0;

vec4 cubic() {
    float width = u_thetas_rad[node_left + 1] - u_thetas_rad[node_left];
    float rise = u_radii_px[node_left + 1] - u_radii_px[node_left];
    vec2 slopes = width * vec2(u_slopes_px[node_left], u_slopes_px[node_left + 1]);
    return vec4(0.0, slopes.x, 3.0 * rise - 2.0 * slopes.x - slopes.y,
                slopes.x + slopes.y - 2.0 * rise);
}

// radius increase since the interval's start, at a fraction of the interval's width
float radius_from_theta(float share) {
    vec4 c = cubic();
    return share * (c.y + share * (c.z + share * c.w));
}

float slope_from_theta(float share) {
    vec4 c = cubic();
    return c.y + share * (2.0 * c.z + share * 3.0 * c.w);
}

#include "camera/parts/theta_from_radius.glsl"

bool ray_from_pixel(vec2 pixel_px, out vec3 ray) {
    vec2 offset_px = pixel_px - u_principal_point_px;
    float radius_px = length(offset_px);
    float inside_px = min(radius_px, u_radii_px[NODES - 1]);
    for (int i = 1; i < NODES - 1; ++i)
        if (u_radii_px[i] <= inside_px && u_radii_px[i + 1] > u_radii_px[i]) node_left = i;
    float share = theta_from_radius(inside_px - u_radii_px[node_left], 0.0, 1.0);
    float width = u_thetas_rad[node_left + 1] - u_thetas_rad[node_left];
    ray = polar_ray(offset_px, radius_px, u_thetas_rad[node_left] + share * width);
    return radius_px <= u_radii_px[NODES - 1];
}
