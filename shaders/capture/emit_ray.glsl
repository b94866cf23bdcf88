// void emit(bool valid, vec3 ray): writes the ray as a unit vector, optical frame, and 1 if valid.

layout(location = 0) out vec4 out_ray;

void emit(bool valid, vec3 ray) {
    out_ray = vec4(normalize(ray), valid ? 1.0 : 0.0);
}
