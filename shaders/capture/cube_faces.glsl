// int face_of(vec3 rig): which face of the cube sees a direction in the rig frame.
// int tile_of(int face, vec2 tangent): which of the face's tiles in the atlas shows it there.
// Also where in the atlas each tile stands.
//
// Handedness: u_face_from_rig holds the faces' own optical frames (right, down, forward), as
// omnisim/cube.py states them. A face's picture has its first row at the top, so tangents to the
// right and down are texture coordinates without any flip.

const int FACES = 6;
const int MAX_TILES = 64;  // as in omnisim/gpu/atlas/tile_plan.py

uniform mat3 u_rig_from_optical;
uniform mat3 u_face_from_rig[FACES];
uniform int u_first_tile[FACES + 1];      // of each face; the next one's is past its last
uniform vec4 u_tile_core[MAX_TILES];     // tangents that are looked up: first two, last two
uniform vec4 u_tile_window[MAX_TILES];   // tangents that are drawn, likewise
uniform vec4 u_tile_place[MAX_TILES];    // atlas coordinates: of tangent 0, and length of a tangent of 1
uniform float u_tile_texels[MAX_TILES];  // texels in a tangent of 1

int face_of(vec3 rig) {
    vec3 size = abs(rig);
    int side = size.x >= size.y ? (rig.x > 0.0 ? 0 : 2) : (rig.y > 0.0 ? 1 : 3);
    int end = rig.z > 0.0 ? 5 : 4;
    bool is_end = size.z > max(size.x, size.y) && u_first_tile[end] < u_first_tile[end + 1];
    return is_end ? end : side;
}

// Where no tile has it in its core, which a ray of no valid pixel asks for, the nearest one.
int tile_of(int face, vec2 tangent) {
    int nearest = u_first_tile[face];
    float least = 1e30;
    for (int tile = nearest; tile < u_first_tile[face + 1]; ++tile) {
        vec2 outside = max(u_tile_core[tile].xy - tangent, tangent - u_tile_core[tile].zw);
        float distance = max(outside.x, outside.y);
        if (distance < least) {
            least = distance;
            nearest = tile;
        }
    }
    return nearest;
}
