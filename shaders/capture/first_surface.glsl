// FirstSurface first_surface(vec3 ray, vec3 origin, float start): the end of a ray from beside the
//     viewpoint, no nearer than a nearness to start at; u_nearest is that of the nearest of all.
// Place place_of(vec3 direction, vec3 origin): texel of the atlas that shows a direction.
// float nearness_at(Place place): of what that texel shows.
// All in the rig frame, the viewpoint at 0; rays and origins are not long against what they meet.
//
// A point of the ray, s from its origin, is seen along ray + w origin from the viewpoint, where
// w = 1/s is its nearness. What a texel shows along that has a nearness m on the same scale. While
// m < w the viewpoint sees past the point, so that nothing is there; at the ray's end m = w. If m
// leaps above w the ray continues behind something, where the viewpoint sees nothing of it: not
// known.
// Largest m of blocks of texels let the search, which begins at the nearest of all, pass through
// empty space in few steps. With GUESS there is a likely end also where none is known.
// Source: Uludag, "Hi-Z screen-space cone-traced reflections", GPU Pro 5, 2014.

uniform sampler2D u_depth;   // of the atlas's texels
uniform sampler2D u_blocks;  // largest inverse depth within BLOCK texels, and within GROUP texels
uniform sampler2D u_cells;   // of each face: texel = xy + tangent * zw; 0: no tile has it
uniform vec2 u_inverse_z_from_depth;  // factor and offset; 0 is what is cleared
uniform float u_nearest;     // largest nearness of all
uniform float u_near_m;      // of a cube about a ray's origin, as the virtual cameras' planes are
uniform mat3 u_face_from_rig[6];

const int CELLS = 64;  // per side of a face
const int BLOCK = 8, GROUP = 64;  // as in depth_pyramid.py
const int MAX_LOOK_UPS = 48, GUESSES = 4;
const float STEP_TEXELS = 1.5;  // of the search where something may be
const float SAME_TEXELS = 1.0;  // a lookup that moves by less stays

struct Place {
    vec2 texel;
    vec2 tangent;      // on its face
    int face;
    vec4 cell;         // see u_cells
    float depth;       // of the direction, as long as it is, in its face
    float texels;      // that it moves by if w grows by 1
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

float nearness_at(Place place) {
    return inverse_z_at(place.texel) * place.depth;
}

FirstSurface first_surface(vec3 ray, vec3 origin, float start) {
    float w = start, before = w;
    bool leapt = false;    // by more texels than one
    bool careful = false;  // near the edge of a tile, beyond which blocks tell nothing
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
        // depths are those of faces: along a ray they differ a little over a block
        bounds *= 1.0 + vec2(BLOCK, GROUP) / place.cell.z;
        float seen = nearness_at(place);
        float texels = (w - seen) * place.texels;
        if (texels < SAME_TEXELS) {
            // a surface before the ray's near plane is not there for it
            found = FirstSurface(seen, texels > -STEP_TEXELS && seen <= limit);
            break;
        }
        // as far as any of the three lets it go
        vec3 steps = vec3(STEP_TEXELS, BLOCK, GROUP) / place.texels;
        vec3 ends = max(vec3(seen, bounds), w - steps);
        float leap = min(ends.y, ends.z);
        leapt = !careful && leap < ends.x;
        w = leapt ? leap : ends.x;
    }
#ifdef GUESS
    // from infinity on, as if what hides the ray were thin
    float guess = 0.0;
    for (int i = 0; i < GUESSES; ++i) guess = nearness_at(place_of(ray + guess * origin, origin));
    if (!found.known) found.nearness = guess;
#endif
    return found;
}
