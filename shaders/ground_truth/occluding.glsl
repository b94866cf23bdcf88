// Point hit by the ray of a pixel, in the frame of the next pose.
// bool point_of(ivec2 pixel, out uvec2 primitive, out vec3 point): false where the pixel has no
// ray; the point is a direction where nothing was hit.

uniform sampler2D u_rays;             // unit, optical frame; and 1 where the pixel has one
uniform sampler2D u_points;           // written by hits.frag
uniform usampler2D u_hit_primitives;  // written by hits.frag
uniform mat3 u_rig_from_viewpoint;    // of the next pose

layout(location = 0) out uint out_occluded;

// A hit nearer than the point by more than this share occludes it. Ranges of the same point agree
// to 1e-6; the margin is for rays that meet a triangle too small to show in any texel.
const float NEARER = 1e-3;
const uint ITEM_BITS = 0x7FFFFFFFu;  // without the mark of an unknown end

bool point_of(ivec2 pixel, out uvec2 primitive, out vec3 point) {
    primitive = texelFetch(u_hit_primitives, pixel, 0).xy;
    primitive.x &= ITEM_BITS;
    point = texelFetch(u_points, pixel, 0).xyz;
    if (primitive.x != 0u)
        point = transformed(matrix_at(primitive.x - 1u, SECOND_MATRIX), vec4(point, 1.0));
    return texelFetch(u_rays, pixel, 0).w >= 0.5;
}
