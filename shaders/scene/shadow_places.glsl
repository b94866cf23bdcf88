// Positions on the maps of directional and spot lights.
// vec3 place_on_map(int place, vec3 position): map coordinates, in a light's axes, of a position in
//     meters from the effective viewpoint. Directional light: x and y on its largest map, from -1
//     to 1, and depth toward the light in the same unit. Spot light: meters from the light.
// Coordinates are linear in the position, so that vertices can interpolate them.
// PLACES: number of these maps. The layout is that of
// omnisim/rendering/opengl/shadows/shadow_plan.py.

layout(std140, binding = 1) uniform ShadowMaps {
    mat3x4 u_place_from_anchor[PLACES];
#if SHADOW_CASCADES > 1
    vec4 u_cascade_from_place[PLACES * (SHADOW_CASCADES - 1)];  // shift and scale, small maps first
#endif
};

vec3 place_on_map(int place, vec3 position) {
    return vec4(position + SHADOW_VIEWPOINT, 1.0) * u_place_from_anchor[place];
}
