// void emit(bool valid, vec3 ray): writes the atlas's texture coordinates, negative for an invalid
// ray, and the mip level.

#include "capture/uv.glsl"
layout(location = 0) out vec2 out_uv;
layout(location = 1) out float out_level;

void emit(bool valid, vec3 ray) {
    vec3 uv_level = uv_level_from_ray(ray);
    out_uv = valid ? uv_level.xy : vec2(-1.0);
    out_level = uv_level.z;
}
