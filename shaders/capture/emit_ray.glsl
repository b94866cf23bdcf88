// void emit(bool valid, vec3 ray): writes the unit ray, optical frame, and 1 where it is valid.

layout(location = 0) out vec4 out_ray;

void emit(bool valid, vec3 ray) {
    out_ray = vec4(normalize(ray), valid ? 1.0 : 0.0);
}
