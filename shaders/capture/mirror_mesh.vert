// Vertex of the mirror mesh, seen by the pinhole camera that looks at the mirror.
// in_position       mirror frame, in units of c: viewpoint at 0, pinhole at (0, 0, 1)
// u_first_px        pixel of the image in the target's corner
// u_target_size_px  size of the target
#version 450 core

uniform vec2 u_target_size_px;
uniform vec2 u_first_px;
uniform float u_focal_length_px;
uniform vec2 u_principal_point_px;

in vec3 in_position;
out vec3 v_ray;

void main() {
    // relative to the pinhole, in the optical frame: half a turn about x from the mirror frame
    vec3 seen = vec3(in_position.x, -in_position.y, 1.0 - in_position.z);
    vec2 pixel_times_depth = u_focal_length_px * seen.xy + u_principal_point_px * seen.z;
    // a pixel's center is half a pixel inside its corner
    vec2 corner = pixel_times_depth + (0.5 - u_first_px) * seen.z;
    vec2 clip = 2.0 * corner / u_target_size_px - seen.z;
    gl_Position = vec4(clip, 0.0, seen.z);
    v_ray = vec3(in_position.x, -in_position.yz);  // relative to the viewpoint, optical frame
}
