// Outputs per ray: point, range, primitive, and the requested details.
// void write_nothing(vec3 ray): outputs without a hit, or without a ray.
// void write_hit(vec3 ray, vec3 start, vec3 texel, Hit hit): outputs of a hit. start: the ray's
//     origin in the viewpoint frame; texel: atlas position that shows the ray's end.

// Point in the viewpoint frame, and range. Range infinite: no hit, and the point is a direction.
layout(location = 0) out vec4 out_point;
layout(location = 1) out uvec2 out_primitive;  // 1 + draw item, and triangle in it; 0: no hit
#define FIRST_DETAIL 2
#include "ground_truth/hit_normal.glsl"
#include "ground_truth/hit_material.glsl"

void write_nothing(vec3 ray) {
    out_point = vec4(ray, INFINITE);
    out_primitive = uvec2(0u);
    write_no_normal();
    write_no_albedo();
    write_no_gloss();
}

void write_hit(vec3 ray, vec3 start, vec3 texel, Hit hit) {
    out_point = vec4(start + hit.range * ray, hit.range);
    out_primitive = hit.primitive;
    write_normal(hit);
    write_material(texel, hit);
}
