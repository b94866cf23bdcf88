// int face_of(vec3 rig): face of the cube in a direction in the rig frame.
// int tile_of(int face, vec2 tangent): tile of the atlas with this part of the face.
//
// Handedness: u_face_from_rig holds the faces' own optical frames (right, down, forward), as
// omnisim/core/cube.py states them. A face's image has its first row at the top, so tangents to
// the right and down are texture coordinates without any flip.

const int FACES = 6;
const int MAX_TILES = 64;  // as in omnisim/rendering/opengl/atlas/tile_plan.py
const float MIN_DEPTH = 1e-30;  // of a ray in its face: of none, and along a face without tiles, 0

uniform mat3 u_rig_from_optical;
uniform mat3 u_face_from_rig[FACES];
uniform int u_first_tile[FACES + 1];            // of each face; the next one's is past its last
uniform vec4 u_tile_region[MAX_TILES];         // tangents that it is read at: first two, last two
uniform vec4 u_tile_padded_region[MAX_TILES];  // tangents that are drawn: first two, last two
uniform vec4 u_uv_from_tangent[MAX_TILES];     // offset, then scale
uniform float u_tile_px_per_tan[MAX_TILES];    // texels per tangent of 1

int face_of(vec3 rig) {
    vec3 size = abs(rig);
    int side = size.x >= size.y ? (rig.x > 0.0 ? 0 : 2) : (rig.y > 0.0 ? 1 : 3);
    int end = rig.z > 0.0 ? 5 : 4;
    bool is_end = size.z > max(size.x, size.y) && u_first_tile[end] < u_first_tile[end + 1];
    return is_end ? end : side;
}

// The nearest tile, where none has the tangent in its region: no ray of a valid pixel asks for it.
int tile_of(int face, vec2 tangent) {
    int nearest = min(u_first_tile[face], MAX_TILES - 1);  // of a face without any: the next one's
    float least = 1e30;
    for (int tile = nearest; tile < u_first_tile[face + 1]; ++tile) {
        vec2 outside = max(u_tile_region[tile].xy - tangent, tangent - u_tile_region[tile].zw);
        float distance = max(outside.x, outside.y);
        if (distance < least) {
            least = distance;
            nearest = tile;
        }
    }
    return nearest;
}
