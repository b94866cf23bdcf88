// Point spread: mean of the valid pixels, weighted by a normal distribution whose radial and
// tangential widths depend on the image radius.
#version 450 core

uniform sampler2D u_image;
uniform sampler2D u_widths_px;  // radial and tangential widths, by image radius and its direction
uniform vec2 u_center_px;
uniform float u_radius_scale;  // table entries per pixel of radius
uniform float u_reach;         // radius of the kernel, in widths
layout(location = 0) out vec4 out_value;

// Table entry before a position, and weight of the next entry.
float split(float at, int count, out int entry) {
    float within = min(at, float(count - 1));
    entry = min(int(within), count - 2);
    return within - float(entry);
}

vec2 widths_at(float radius_px, vec2 outward) {
    ivec2 size = textureSize(u_widths_px, 0);
    ivec2 entry;
    vec2 part = abs(outward);
    float tangent = min(part.x, part.y) / max(part.x, part.y);
    float across = split(radius_px * u_radius_scale, size.x, entry.x);
    float down = split(tangent * float(size.y - 1), size.y, entry.y);
    vec4 upper = texelFetch(u_widths_px, entry, 0) * (1.0 - across)
        + texelFetch(u_widths_px, entry + ivec2(1, 0), 0) * across;
    vec4 lower = texelFetch(u_widths_px, entry + ivec2(0, 1), 0) * (1.0 - across)
        + texelFetch(u_widths_px, entry + ivec2(1, 1), 0) * across;
    return (upper * (1.0 - down) + lower * down).xy;
}

void main() {
    ivec2 middle = ivec2(gl_FragCoord.xy);
    vec4 own = texelFetch(u_image, middle, 0);
    vec2 offset_px = gl_FragCoord.xy - 0.5 - u_center_px;
    float radius_px = sqrt(dot(offset_px, offset_px));
    vec2 outward = radius_px > 1e-3 ? offset_px / radius_px : vec2(1.0, 0.0);
    vec2 widths_px = widths_at(radius_px, outward);
    int reach = int(ceil(u_reach * max(widths_px.x, widths_px.y)));
    ivec2 first = max(middle - reach, ivec2(0));
    ivec2 last = min(middle + reach, textureSize(u_image, 0) - 1);
    vec4 total = vec4(0.0);
    for (int row = first.y; row <= last.y; ++row)
        for (int column = first.x; column <= last.x; ++column) {
            ivec2 pixel = ivec2(column, row);
            vec4 value = texelFetch(u_image, pixel, 0);
            vec2 away = vec2(pixel - middle);
            float radial = dot(away, outward) / widths_px.x;
            float across = (away.y * outward.x - away.x * outward.y) / widths_px.y;
            if (value.a > 0.5)
                total += exp(-0.5 * (radial * radial + across * across)) * vec4(value.rgb, 1.0);
        }
    out_value = own.a > 0.5 ? vec4(total.rgb / total.a, own.a) : own;
}
