// bool ray_from_pixel(vec2 pixel_px, out vec3 ray): the orthographic camera that looks at a
// parabolic mirror. The ray is a unit direction in the optical frame; false past the rim.
// Twin of omnisim/cameras/mirrors/parabolic.py. Source: r = h tan(theta/2), see there.

uniform float u_horizon_radius_px;
uniform vec2 u_principal_point_px;
uniform float u_rim_half_tangent;  // tan(theta_max/2)

bool ray_from_pixel(vec2 pixel_px, out vec3 ray) {
    // tan(theta/2) toward the azimuth, a stereographic image of the ray
    vec2 half_tangent = (pixel_px - u_principal_point_px) / u_horizon_radius_px;
    float radius = length(half_tangent);
    half_tangent *= u_rim_half_tangent / max(radius, u_rim_half_tangent);
    float squared = dot(half_tangent, half_tangent);
    ray = vec3(2.0 * half_tangent, squared - 1.0) / (1.0 + squared);
    return radius <= u_rim_half_tangent;
}
