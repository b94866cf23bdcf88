// Ray ray_of(ivec2 pixel, int part): ray of a sample.
// float level_at(ivec2 pixel, Place place): mip level of a pixel's samples; 0 without MIP_LEVELS.
// Textures with one texel per pixel center, plus MARGIN texels on each side, have the center's ray.
// The samples' rays are interpolated between them, except at the rim, where samples have their own.
// SUPERSAMPLING: samples per pixel side.

uniform sampler2D u_rays;      // unit direction in the rig frame; share of samples with a ray
uniform sampler2D u_origins;   // origin; 1 + first texel in u_rim_rays, or 0
uniform sampler2D u_rim_rays;  // per sample: direction, then origin
#ifdef MIP_LEVELS
uniform float u_max_level;
uniform float u_level_bias;
#endif

const int MARGIN = 2, RIM_ROW_BITS = 12;

struct Ray {
    vec3 direction, origin;
};

vec2 offset_of(int part) {
    vec2 at = vec2(part % SUPERSAMPLING, part / SUPERSAMPLING);
    return (at + 0.5) / float(SUPERSAMPLING) - 0.5;
}

vec3 rim_ray(int at) {
    return texelFetch(u_rim_rays, ivec2(at & ((1 << RIM_ROW_BITS) - 1), at >> RIM_ROW_BITS), 0).xyz;
}

// Interpolates between pixel centers by a parabola along each axis.
Ray ray_of(ivec2 pixel, int part) {
    ivec2 at = pixel + MARGIN;
    int rim = int(texelFetch(u_origins, at, 0).w) - 1;
    vec2 offset = offset_of(part);
    vec2 weights[3] = vec2[3](
        0.5 * offset * (offset - 1.0), 1.0 - offset * offset, 0.5 * offset * (offset + 1.0));
    Ray ray = Ray(vec3(0.0), vec3(0.0));
    for (int row = 0; row < 3; ++row)
        for (int column = 0; column < 3; ++column) {
            float weight = weights[row].y * weights[column].x;
            ivec2 there = at + ivec2(column, row) - 1;
            ray.direction += weight * texelFetch(u_rays, there, 0).xyz;
            ray.origin += weight * texelFetch(u_origins, there, 0).xyz;
        }
    int own = max(rim, 0) + 2 * part;
    if (rim >= 0) ray = Ray(rim_ray(own), rim_ray(own + 1));
    return ray;
}

#ifdef MIP_LEVELS
vec3 step_along(ivec2 at, ivec2 way, vec3 ray) {
    vec3 next = texelFetch(u_rays, at + way, 0).xyz, last = texelFetch(u_rays, at - way, 0).xyz;
    vec3 change = next != vec3(0.0) ? next - ray : last != vec3(0.0) ? ray - last : vec3(0.0);
    return change / float(SUPERSAMPLING);
}

float level_at(ivec2 pixel, Place place) {
    ivec2 at = pixel + MARGIN;
    vec3 ray = texelFetch(u_rays, at, 0).xyz;
    vec3 right = u_face_from_rig[place.face] * step_along(at, ivec2(1, 0), ray);
    vec3 down = u_face_from_rig[place.face] * step_along(at, ivec2(0, 1), ray);
    vec2 dx = (right.xy - place.tangent * right.z) / place.depth;
    vec2 dy = (down.xy - place.tangent * down.z) / place.depth;
    float texels = place.cell.z * sqrt(max(max(dot(dx, dx), dot(dy, dy)), 1e-20));
    return ray == vec3(0.0) ? 0.0 : clamp(log2(texels) + u_level_bias, 0.0, u_max_level);
}
#else
float level_at(ivec2 pixel, Place place) { return 0.0; }
#endif
