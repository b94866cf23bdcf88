// A vertex of the rectangles that cover the picture's valid pixels.
// With BATCH an instance is a picture, below the one before.
// in_corner_px  counted from the corner of the first row's first pixel
#version 450 core

uniform vec2 u_picture_size_px;
in vec2 in_corner_px;
#ifdef BATCH
uniform int u_pictures;  // that the target has room for
flat out int v_picture;
#endif

void main() {
#ifdef BATCH
    v_picture = gl_InstanceID;
    vec2 corner_px = in_corner_px + vec2(0.0, float(gl_InstanceID) * u_picture_size_px.y);
    vec2 size_px = u_picture_size_px * vec2(1.0, float(u_pictures));
    gl_Position = vec4(2.0 * corner_px / size_px - 1.0, 0.0, 1.0);
#else
    gl_Position = vec4(2.0 * in_corner_px / u_picture_size_px - 1.0, 0.0, 1.0);
#endif
}
