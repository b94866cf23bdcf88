// bool mirrored_light(vec3 position, out vec3 light): light, linear RGB, that reaches a planar mirror
//     from the mirror's direction; false: no mirrored view shows it. position: meters from the
//     viewpoint.
// A mirrored view has the atlas coordinates of the view itself. Owners are the numbers of the
// mirrored views, counted from 1, see omnisim/rendering/opengl/drawing/mirror_pass.py.

uniform sampler2D u_mirrored;
uniform usampler2D u_mirror_owners;
uniform vec4 u_mirror_planes[PLANAR_MIRRORS];  // unit normal, and the viewpoint's height in meters
const float SAME_PLANE = 1e-3;  // meters, and share of the distance

bool is_own(uint owner, vec3 position) {
    if (owner == 0u) return false;
    vec4 plane = u_mirror_planes[owner - 1u];
    return abs(dot(plane.xyz, position) + plane.w) <= SAME_PLANE * (1.0 + length(position));
}

bool mirrored_light(vec3 position, out vec3 light) {
    ivec2 at = ivec2(gl_FragCoord.xy);
    light = texelFetch(u_mirrored, at, 0).rgb;
    if (is_own(texelFetch(u_mirror_owners, at, 0).r, position)) return true;
    // with several samples per texel, a mirror may not reach its center
    for (int side = 0; side < 9; ++side) {
        ivec2 beside = at + ivec2(side % 3, side / 3) - 1;
        if (!is_own(texelFetch(u_mirror_owners, beside, 0).r, position)) continue;
        light = texelFetch(u_mirrored, beside, 0).rgb;
        return true;
    }
    return false;
}
