// bool ray_from_pixel(vec2 pixel_px, out vec3 ray): the pinhole camera that looks into an elliptic
// mirror. The ray is a unit direction in the optical frame; false past the rim.
// Twin of omnisim/cameras/mirrors/elliptic.py. Source: tan(theta/2) = K tan(beta/2), see there.

uniform float u_focal_length_px;
uniform vec2 u_principal_point_px;
uniform float u_half_angle_ratio;  // K
uniform float u_rim_half_tangent;  // tan(theta_max/2)

bool ray_from_pixel(vec2 pixel_px, out vec3 ray) {
    vec2 tangent = (pixel_px - u_principal_point_px) / u_focal_length_px;
    // half: tan(theta/2) toward the mirror point, opposite to the scene point that it shows
    vec2 half_tangent =
        tangent * (u_half_angle_ratio / (1.0 + sqrt(1.0 + dot(tangent, tangent))));
    float radius = length(half_tangent);
    half_tangent *= u_rim_half_tangent / max(radius, u_rim_half_tangent);
    float squared = dot(half_tangent, half_tangent);
    ray = vec3(-2.0 * half_tangent, squared - 1.0) / (1.0 + squared);
    return radius <= u_rim_half_tangent;
}
