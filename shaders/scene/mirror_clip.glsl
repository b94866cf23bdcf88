// void clip_at_mirror(): with IN_MIRROR, clips the vertex's triangles at the plane of the mirror in
// which the scene is seen. Call it after pass_placement().
// u_mirror  unit normal of the mirror, toward its reflecting side, and height of the mirrored
//           viewpoint above it, in meters: negative

#ifdef IN_MIRROR
uniform vec4 u_mirror;
// Surfaces in the plane itself are clipped, in spite of rounding.
const float CLIP_M = 1e-4, CLIP_SHARE = 1e-6;

void clip_at_mirror() {
    float height_m = dot(u_mirror.xyz, v_position) + u_mirror.w;
    gl_ClipDistance[4] = height_m - CLIP_M + CLIP_SHARE * u_mirror.w;
}
#else
void clip_at_mirror() {}
#endif
