// A vertex of the rectangles that cover the picture's valid pixels.
// in_corner_px  counted from the corner of the first row's first pixel
#version 430 core

uniform vec2 u_picture_size_px;
in vec2 in_corner_px;

void main() {
    gl_Position = vec4(2.0 * in_corner_px / u_picture_size_px - 1.0, 0.0, 1.0);
}
