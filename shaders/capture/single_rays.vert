// Vertex of a pixel with a ray of its own, drawn as a point.
// in_pixel_px  right and down
// in_ray       unit vector, optical frame, and 1 if valid
#version 450 core

uniform vec2 u_image_size_px;
in vec2 in_pixel_px;
in vec4 in_ray;
flat out vec4 v_ray;

void main() {
    gl_Position = vec4(2.0 * (in_pixel_px + 0.5) / u_image_size_px - 1.0, 0.0, 1.0);
    gl_PointSize = 1.0;
    v_ray = in_ray;
}
