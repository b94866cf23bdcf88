// void emit(bool valid, vec3 ray): the one place where a capture decides what a pixel holds.
// With EMIT_RAY: the unit ray in the optical frame, and 1 where it is valid. With EMIT_LOOKUP: where
// in the atlas to look, below 0 where it is not valid, and the mip level. Otherwise: the linear colour
// in its direction, and alpha 1 where the camera sees something.

#if defined(EMIT_RAY)
layout(location = 0) out vec4 out_value;

void emit(bool valid, vec3 ray) {
    out_value = vec4(normalize(ray), valid ? 1.0 : 0.0);
}
#elif defined(EMIT_LOOKUP)
#include "capture/cube_lookup.glsl"
layout(location = 0) out vec2 out_place;
layout(location = 1) out float out_level;

void emit(bool valid, vec3 ray) {
    vec3 lookup = lookup_of_ray(ray);
    out_place = valid ? lookup.xy : vec2(-1.0);
    out_level = lookup.z;
}
#else
#include "capture/cube_lookup.glsl"
layout(location = 0) out vec4 out_value;

void emit(bool valid, vec3 ray) {
    // looked up for every pixel, so that derivatives exist at the border too
    vec3 color = color_from_ray(ray);
    out_value = valid ? vec4(color, 1.0) : vec4(0.0);
}
#endif
