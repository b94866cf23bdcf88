// One pixel of the wide image: its ray by the lens's formula, looked up in the cube; the target
// encodes to sRGB. The formula is that of a hyperbolic mirror, as in omnisim/cameras/mirrors/hyperbolic.py.
#version 430 core

uniform float u_focal_length_px;
uniform vec2 u_principal_point_px;
uniform float u_half_angle_ratio;  // tan(theta / 2) over tan(beta / 2)
uniform float u_rim_half_tangent;
uniform mat3 u_cube_from_optical;
uniform samplerCube u_cube;

layout(location = 0) out vec4 out_color;

void main() {
    vec2 tangent = (gl_FragCoord.xy - 0.5 - u_principal_point_px) / u_focal_length_px;
    vec2 half_tangent =
        tangent * (u_half_angle_ratio / (1.0 + sqrt(1.0 + dot(tangent, tangent))));
    float squared = dot(half_tangent, half_tangent);
    vec3 ray = vec3(2.0 * half_tangent, squared - 1.0);
    vec3 color = textureLod(u_cube, u_cube_from_optical * ray, 0.0).rgb;
    float rim = u_rim_half_tangent;
    out_color = squared <= rim * rim ? vec4(color, 1.0) : vec4(0.0, 0.0, 0.0, 1.0);
}
