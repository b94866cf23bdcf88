// Light meter: sums of luminance (Rec. 709) and of valid pixels over a block of the image.
#version 450 core

uniform sampler2D u_image;
uniform int u_block_px;
layout(location = 0) out vec4 out_value;

void main() {
    ivec2 corner = ivec2(gl_FragCoord.xy) * u_block_px;
    ivec2 end = min(corner + u_block_px, textureSize(u_image, 0));
    vec2 total = vec2(0.0);
    for (int row = corner.y; row < end.y; ++row)
        for (int column = corner.x; column < end.x; ++column) {
            vec4 value = texelFetch(u_image, ivec2(column, row), 0);
            if (value.a > 0.5)
                total += vec2(dot(value.rgb, vec3(0.2126, 0.7152, 0.0722)), 1.0);
        }
    out_value = vec4(total, 0.0, 0.0);
}
