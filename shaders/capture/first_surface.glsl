// FirstSurface first_surface(vec3 ray, vec3 origin, float start): first surface along a ray from
//     beside the viewpoint, at a nearness of at most start.
// Place place_of(vec3 direction, vec3 origin): texel of the atlas that shows a direction.
// float nearness_at(Place place): nearness of the surface in that texel.
// float largest_nearness(): largest nearness of any surface.
// Vectors are in the rig frame, with the viewpoint at 0. Origins are short compared with ranges.
//
// From the viewpoint, the point of the ray at distance s appears in the direction ray + w origin,
// where w = 1/s is the point's nearness. The texel in that direction shows a surface of nearness m
// on the same scale. If m < w, the viewpoint sees past the point, so the ray continues. At the
// first surface, m = w. If m leaps above w, the ray continues hidden from the viewpoint, and its
// first surface is unknown; with GUESS the result is then a likely one.
// The search starts at the largest nearness. Upper bounds of m over blocks of texels, which
// depth_bounds.comp finds, let it cross empty space in few steps.
// Source: Uludag, "Hi-Z screen-space cone-traced reflections", GPU Pro 5, 2014.

uniform sampler2D u_depth;   // depth of the atlas's texels
uniform sampler2D u_blocks;  // largest inverse depth within BLOCK texels, and within GROUP texels
uniform sampler2D u_cells;   // cells per face: texel = xy + tangent * zw; 0: in no tile
uniform vec2 u_inverse_z_from_depth;  // factor and offset; a depth of 0 is empty
uniform float u_near_m;      // distance of the near planes, which form a cube about a ray's origin
uniform mat3 u_face_from_rig[6];

const int CELLS = 64;  // per side of a face
const int BLOCK = 8, GROUP = 64;  // as in depth_pyramid.py
const int MAX_LOOK_UPS = 48, GUESSES = 4;
const float STEP_TEXELS = 1.5;  // step of the search near surfaces
const float SAME_TEXELS = 1.0;  // lookups that differ by less show the same surface

struct Place {
    vec2 texel;
    vec2 tangent;      // position on the face
    int face;
    vec4 cell;         // entry of u_cells
    float depth;       // z of the direction vector in the face's frame
    float texels;      // motion in the atlas per unit of w
};

struct FirstSurface {
    float nearness;
    bool known;
};

Place place_of(vec3 direction, vec3 origin) {
    Place place;
    vec3 size = abs(direction);
    place.face = size.z > max(size.x, size.y) ? (direction.z > 0.0 ? 5 : 4)
        : size.x >= size.y ? (direction.x > 0.0 ? 0 : 2) : (direction.y > 0.0 ? 1 : 3);
    vec3 local = u_face_from_rig[place.face] * direction;
    local.z = max(local.z, 1e-30);  // a pixel without a ray has no direction
    vec3 aside = u_face_from_rig[place.face] * origin;
    place.depth = local.z;
    place.tangent = local.xy / local.z;
    ivec2 cell = clamp(ivec2(0.5 * float(CELLS) * (place.tangent + 1.0)), 0, CELLS - 1);
    place.cell = texelFetch(u_cells, ivec2(cell.x + CELLS * place.face, cell.y), 0);
    place.texel = place.cell.xy + place.tangent * place.cell.zw;
    place.texels = max(place.cell.z * length(aside.xy - place.tangent * aside.z) / local.z, 1e-6);
    return place;
}

float inverse_z_at(vec2 texel) {
    float depth = texelFetch(u_depth, ivec2(texel), 0).r;
    return depth > 0.0 ? u_inverse_z_from_depth.x * depth + u_inverse_z_from_depth.y : 0.0;
}

float largest_nearness() {
    return texelFetch(u_blocks, ivec2(0, textureSize(u_blocks, 0).y - 1), 0).r;
}

float nearness_at(Place place) {
    return inverse_z_at(place.texel) * place.depth;
}

FirstSurface first_surface(vec3 ray, vec3 origin, float start) {
    float w = start, before = w;
    bool leapt = false;    // the last step exceeded a texel
    bool careful = false;  // near a tile's edge, beyond which the bounds of blocks are invalid
    vec2 tile = vec2(-1.0);
    float limit = max(max(abs(ray.x), abs(ray.y)), abs(ray.z)) / u_near_m;
    FirstSurface found = FirstSurface(0.0, false);
    for (int i = 0; i < MAX_LOOK_UPS; ++i) {
        Place place = place_of(ray + w * origin, origin);
        if (place.cell.z <= 0.0) break;
        bool is_other_tile = place.cell.xy != tile;
        if (is_other_tile && leapt) {
            careful = true;
            leapt = false;
            w = before;
            continue;
        }
        if (is_other_tile) careful = false;
        tile = place.cell.xy;
        before = w;
        vec2 bounds = texelFetch(u_blocks, ivec2(place.texel) / BLOCK, 0).rg * place.depth;
        // within a block, depths in the face differ slightly from those along the ray
        bounds *= 1.0 + vec2(BLOCK, GROUP) / place.cell.z;
        float seen = nearness_at(place);
        float texels = (w - seen) * place.texels;
        if (texels < SAME_TEXELS) {
            // surfaces in front of the ray's near plane do not count
            found = FirstSurface(seen, texels > -STEP_TEXELS && seen <= limit);
            break;
        }
        // the longest step that a texel, its block or its group allows
        vec3 steps = vec3(STEP_TEXELS, BLOCK, GROUP) / place.texels;
        vec3 ends = max(vec3(seen, bounds), w - steps);
        float leap = min(ends.y, ends.z);
        leapt = !careful && leap < ends.x;
        w = leapt ? leap : ends.x;
    }
#ifdef GUESS
    // iterate from infinity, as if the surface that hides the ray were thin
    float guess = 0.0;
    for (int i = 0; i < GUESSES; ++i) guess = nearness_at(place_of(ray + guess * origin, origin));
    if (!found.known) found.nearness = guess;
#endif
    return found;
}
