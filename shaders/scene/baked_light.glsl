// Baked light of a scene: its lamps, sky and bounces, with their shadows.
// vec3 baked_light(vec3 position, vec3 normal): light on a white surface, linear RGB. position:
//     meters from the effective viewpoint; normal: unit vector; both in world axes.
// LIGHTMAP: static surfaces read a lightmap; with BOTH_SIDES, at the coordinates of the visible
// side. PROBES: other surfaces interpolate spherical harmonics of order 2 between grid probes. With
// both, a negative lightmap coordinate selects the probes.
// Twin of omnisim/scene/light/baked_light.py.

#ifdef LIGHTMAP
#ifdef BOTH_SIDES
in vec4 v_light_coordinate;
#define LIGHT_PLACE (gl_FrontFacing ? v_light_coordinate.xy : v_light_coordinate.zw)
#else
in vec2 v_light_coordinate;
#define LIGHT_PLACE v_light_coordinate
#endif
uniform sampler2D u_lightmap;  // a single mip level, so that lookups need no derivatives

vec3 lightmap_light() {
    return texture(u_lightmap, LIGHT_PLACE).rgb;
}
#endif

#ifdef PROBES
// Blocks along z, with four numbers each: weighted coefficients, then weights.
uniform sampler3D u_probes;
uniform vec3 u_probes_per_m;
#ifdef LAYERED
#define PROBES_VIEWPOINT (-light_positions[v_camera * POSITIONS + PROBES_POSITION].xyz)
#else
uniform vec3 u_probes_viewpoint;  // viewpoint, in meters from the first probe
#define PROBES_VIEWPOINT u_probes_viewpoint
#endif
const float PROBE_BLOCKS = 7.0;

vec3 probe_light(vec3 position, vec3 n) {
    vec3 size = vec3(textureSize(u_probes, 0)) / vec3(1.0, 1.0, PROBE_BLOCKS);
    vec3 place = (position + PROBES_VIEWPOINT) * u_probes_per_m;
    place = (clamp(place, vec3(0.0), size - 1.0) + 0.5) / vec3(size.xy, size.z * PROBE_BLOCKS);
#define PROBE_BLOCK(i) textureLod(u_probes, place + vec3(0.0, 0.0, i / PROBE_BLOCKS), 0.0)
    vec4 a = PROBE_BLOCK(0.0), b = PROBE_BLOCK(1.0), c = PROBE_BLOCK(2.0), d = PROBE_BLOCK(3.0);
    vec4 e = PROBE_BLOCK(4.0), f = PROBE_BLOCK(5.0), g = PROBE_BLOCK(6.0);
    vec3 total = a.rgb
        + vec3(a.a, b.rg) * n.y + vec3(b.ba, c.r) * n.z + c.gba * n.x
        + d.rgb * (n.x * n.y) + vec3(d.a, e.rg) * (n.y * n.z)
        + vec3(e.ba, f.r) * (3.0 * n.z * n.z - 1.0) + f.gba * (n.x * n.z)
        + g.rgb * (n.x * n.x - n.y * n.y);
    return max(total / g.a, 0.0);
}
#endif

vec3 baked_light(vec3 position, vec3 normal) {
#if defined(LIGHTMAP) && defined(PROBES)
    return v_light_coordinate.x < 0.0 ? probe_light(position, normal) : lightmap_light();
#elif defined(PROBES)
    return probe_light(position, normal);
#else
    return lightmap_light();
#endif
}
