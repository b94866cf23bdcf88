// int face_of(vec3 rig): which face of the cube sees a direction in the rig frame.
// Also where in the atlas each face stands.
//
// Handedness: u_face_from_rig holds the faces' own optical frames (right, down, forward), as
// omnisim/cube.py states them. A face's picture has its first row at the top, so tangents to the
// right and down are texture coordinates without any flip.

const int FACES = 6;

uniform mat3 u_rig_from_optical;
uniform mat3 u_face_from_rig[FACES];
uniform vec4 u_face_tile[FACES];    // atlas coordinates: middle, and length of a tangent of 1
uniform vec4 u_face_window[FACES];  // tangents that are drawn: first two, last two; 0: no such face

int face_of(vec3 rig) {
    vec3 size = abs(rig);
    int side = size.x >= size.y ? (rig.x > 0.0 ? 0 : 2) : (rig.y > 0.0 ? 1 : 3);
    int end = rig.z > 0.0 ? 5 : 4;
    bool is_end = size.z > max(size.x, size.y) && u_face_window[end].z > u_face_window[end].x;
    return is_end ? end : side;
}
