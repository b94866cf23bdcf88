// vec3 direction_on_face(int face, vec2 at): direction of a point of a cube map's face, at texture
// coordinates from 0 to 1; its largest component is 1.
// Source: OpenGL 4.6, table 8.19.

vec3 direction_on_face(int face, vec2 at) {
    vec2 side = 2.0 * at - 1.0;
    if (face == 0) return vec3(1.0, -side.y, -side.x);
    if (face == 1) return vec3(-1.0, -side.y, side.x);
    if (face == 2) return vec3(side.x, 1.0, side.y);
    if (face == 3) return vec3(side.x, -1.0, -side.y);
    if (face == 4) return vec3(side.x, -side.y, 1.0);
    return vec3(-side.x, -side.y, -1.0);
}
