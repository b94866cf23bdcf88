// Positions on the maps of directional and spot lights.
// vec3 place_on_map(int place, vec3 position): map coordinates of a position in meters from the
// effective viewpoint, along the axes of a light. Directional light: x and y on its (largest) map,
// from -1 to 1, and depth in the same unit, toward the light. Spot light: meters from the light.
// The result is linear in the position, so that vertices can interpolate it.
// PLACES: number of these maps. The layout is that in
// omnisim/rendering/opengl/shadows/shadow_plan.py.

layout(std140, binding = 1) uniform ShadowMaps {
    mat3x4 u_place_from_anchor[PLACES];
#if SHADOW_CASCADES > 1
    vec4 u_cascade_from_place[PLACES * (SHADOW_CASCADES - 1)];  // small to large: shift, and scale
#endif
};

vec3 place_on_map(int place, vec3 position) {
    return vec4(position + SHADOW_VIEWPOINT, 1.0) * u_place_from_anchor[place];
}
