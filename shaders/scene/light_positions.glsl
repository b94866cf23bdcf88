// Positions of lights, in meters from the effective viewpoint.
// PUNCTUAL_POSITION(i): position of a point or spot light. SHADOW_VIEWPOINT: viewpoint relative to
// the shadow maps' origin. With LAYERED, they differ between cameras; v_camera is the camera's
// index.

#ifdef SHADOWS
const int PROBES_POSITION = PUNCTUAL_LIGHTS + 1;
#else
const int PROBES_POSITION = PUNCTUAL_LIGHTS;
#endif
#ifdef BAKED_LIGHT
const int POSITIONS = PROBES_POSITION + 1;
#else
const int POSITIONS = PROBES_POSITION;
#endif
#ifdef LAYERED
// Per camera: punctual lights, shadow maps' origin, first probe.
layout(std430, binding = 15) readonly buffer LightPositions { vec4 light_positions[]; };
#define PUNCTUAL_POSITION(i) light_positions[v_camera * POSITIONS + i].xyz
#define SHADOW_VIEWPOINT (-light_positions[v_camera * POSITIONS + PUNCTUAL_LIGHTS].xyz)
#else
uniform vec3 u_shadow_viewpoint;
#if PUNCTUAL_LIGHTS > 0
uniform vec3 u_punctual_position[PUNCTUAL_LIGHTS];
#endif
#define PUNCTUAL_POSITION(i) u_punctual_position[i]
#define SHADOW_VIEWPOINT u_shadow_viewpoint
#endif
