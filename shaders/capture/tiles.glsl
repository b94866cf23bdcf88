// int face_of(vec3 rig): cube face in a direction, rig frame.
// int tile_of(int face, vec2 tangent): tile of the atlas that contains a tangent of the face, or
//     the nearest tile.
//
// Handedness: u_face_from_rig has the optical frame of each face (right, down, forward), as defined
// in omnisim/core/cube.py. The first row of a face's image is at the top, so tangents to the right
// and down become texture coordinates without a flip.

const int FACES = 6;
const int MAX_TILES = 64;  // as in omnisim/rendering/atlas/tile_plan.py
const float MIN_DEPTH = 1e-30;  // replaces 0: no ray, or one parallel to a face without tiles

uniform mat3 u_rig_from_optical;
uniform mat3 u_face_from_rig[FACES];
uniform int u_first_tile[FACES + 1];           // first tile of each face, and the number of tiles
uniform vec4 u_tile_region[MAX_TILES];         // tangents that are read: minima, then maxima
uniform vec4 u_tile_padded_region[MAX_TILES];  // tangents that are drawn: minima, then maxima
uniform vec4 u_uv_from_tangent[MAX_TILES];     // offset, then scale
uniform float u_tile_px_per_tan[MAX_TILES];    // texels per unit tangent

int face_of(vec3 rig) {
    vec3 size = abs(rig);
    int side = size.x >= size.y ? (rig.x > 0.0 ? 0 : 2) : (rig.y > 0.0 ? 1 : 3);
    int end = rig.z > 0.0 ? 5 : 4;
    bool is_end = size.z > max(size.x, size.y) && u_first_tile[end] < u_first_tile[end + 1];
    return is_end ? end : side;
}

// Rays of valid pixels are always inside a tile's region.
int tile_of(int face, vec2 tangent) {
    int nearest = min(u_first_tile[face], MAX_TILES - 1);  // without tiles: the next face's first
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
