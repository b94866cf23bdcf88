// Position and normal of a fragment in the viewpoint frame.
// vec3 surface_position(): position in meters, with POSITION; otherwise 0 and unused.
// vec3 normal_of_triangle(): normal of any length, on either side. Call it before any discard:
//     derivatives need the whole 2 x 2 block.
// vec3 seen_normal(vec3 triangle_normal): unit normal of the visible side, whatever the winding;
//     the visible side is the lit side. With NORMALS_AGREE, only front sides are visible, and all
//     vertex normals point to them: no normal is missing or flipped.

#ifdef POSITION
in vec3 v_position;

vec3 surface_position() {
    return v_position;
}
#else
vec3 surface_position() {
    return vec3(0.0);
}
#endif

#ifdef LIT
in vec3 v_normal;
#endif

#if !defined(LIT)
vec3 normal_of_triangle() {
    return vec3(0.0);
}
#elif defined(NORMALS_AGREE)
vec3 normal_of_triangle() {
    return vec3(0.0);
}

vec3 seen_normal(vec3 triangle_normal) {
    return v_normal * inversesqrt(max(dot(v_normal, v_normal), 1e-37));
}
#else
vec3 normal_of_triangle() {
    return cross(dFdx(v_position), dFdy(v_position));
}

vec3 seen_normal(vec3 triangle_normal) {
    vec3 flat_normal = triangle_normal * (dot(triangle_normal, v_position) > 0.0 ? -1.0 : 1.0);
    vec3 normal = dot(v_normal, v_normal) > 0.0 ? v_normal : flat_normal;
    normal *= dot(normal, flat_normal) < 0.0 ? -1.0 : 1.0;
    return normal * inversesqrt(max(dot(normal, normal), 1e-37));  // 0 if seen edge-on
}
#endif
