// Vertex of the rectangles that cover the image's valid pixels.
// With BATCH, each instance is an image; images are stacked downwards.
// in_corner_px  position from the outer corner of pixel (0, 0)
#version 450 core

uniform vec2 u_image_size_px;
in vec2 in_corner_px;
#ifdef BATCH
uniform int u_images;  // number of images that the target can hold
flat out int v_image;
#endif

void main() {
#ifdef BATCH
    v_image = gl_InstanceID;
    vec2 corner_px = in_corner_px + vec2(0.0, float(gl_InstanceID) * u_image_size_px.y);
    vec2 size_px = u_image_size_px * vec2(1.0, float(u_images));
    gl_Position = vec4(2.0 * corner_px / size_px - 1.0, 0.0, 1.0);
#else
    gl_Position = vec4(2.0 * in_corner_px / u_image_size_px - 1.0, 0.0, 1.0);
#endif
}
