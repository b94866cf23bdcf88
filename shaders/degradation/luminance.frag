// Light meter: luminance (Rec. 709) of a pixel; -1 for invalid pixels.
#version 450 core

uniform sampler2D u_image;
layout(location = 0) out vec4 out_value;

void main() {
    vec4 value = texelFetch(u_image, ivec2(gl_FragCoord.xy), 0);
    float luminance = dot(value.rgb, vec3(0.2126, 0.7152, 0.0722));
    out_value = vec4(value.a > 0.5 ? luminance : -1.0, 0.0, 0.0, 0.0);
}
