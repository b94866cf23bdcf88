// Point hit by the ray of a pixel, in the frame of the next viewpoint.
// bool point_of(ivec2 pixel, out uvec2 primitive, out vec3 point): false if the pixel has no ray;
// without a hit, the point is a direction.

uniform sampler2D u_rays;             // unit direction, optical frame; and 1 if there is a ray
uniform sampler2D u_points;           // output of hits.frag
uniform usampler2D u_hit_primitives;  // output of hits.frag
uniform mat3 u_rig_from_viewpoint;    // rotation at the next pose

layout(location = 0) out uint out_occluded;

// A hit nearer than the point by more than this share occludes it. Ranges of one point agree to
// 1e-6; the larger margin allows for triangles too small to show in any texel.
const float NEARER = 1e-3;
const uint ITEM_BITS = 0x7FFFFFFFu;  // all bits but that of an unknown end

bool point_of(ivec2 pixel, out uvec2 primitive, out vec3 point) {
    primitive = texelFetch(u_hit_primitives, pixel, 0).xy;
    primitive.x &= ITEM_BITS;
    point = texelFetch(u_points, pixel, 0).xyz;
    if (primitive.x != 0u)
        point = transformed(matrix_at(primitive.x - 1u, SECOND_MATRIX), vec4(point, 1.0));
    return texelFetch(u_rays, pixel, 0).w >= 0.5;
}
