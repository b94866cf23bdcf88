// void emit(bool valid, vec3 ray): writes the atlas's linear color, and alpha 1 where the ray is
// valid.

#include "capture/uv.glsl"
uniform sampler2D u_atlas;
layout(location = 0) out vec4 out_color;

void emit(bool valid, vec3 ray) {
    // sample for every pixel, so that derivatives also exist at the border
    vec3 uv_level = uv_level_from_ray(ray);
    vec3 color = textureLod(u_atlas, uv_level.xy, uv_level.z).rgb;
    out_color = valid ? vec4(color, 1.0) : vec4(0.0);
}
