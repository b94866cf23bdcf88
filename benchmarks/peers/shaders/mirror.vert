// A vertex of the mirror's mesh, seen by the pinhole camera that looks at it.
// in_position is in the mirror frame in units of c: viewpoint at 0, pinhole at (0, 0, 1).
// in_texture_coordinate is on the face of the cube that reflects there.
#version 430 core

uniform vec2 u_image_size_px;
uniform float u_focal_length_px;
uniform vec2 u_principal_point_px;

in vec3 in_position;
in vec2 in_texture_coordinate;
out vec2 v_texture_coordinate;

void main() {
    vec3 seen = vec3(in_position.x, -in_position.y, 1.0 - in_position.z);
    vec2 pixel_times_depth = u_focal_length_px * seen.xy + (u_principal_point_px + 0.5) * seen.z;
    gl_Position = vec4(2.0 * pixel_times_depth / u_image_size_px - seen.z, 0.0, seen.z);
    v_texture_coordinate = in_texture_coordinate;
}
