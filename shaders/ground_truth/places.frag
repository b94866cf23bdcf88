// Where in the atlas the ray of a pixel looks (`place.glsl`); no pose changes it.
#version 430 core

uniform sampler2D u_rays;  // unit, optical frame; and 1 where the pixel has one

layout(location = 0) out vec4 out_place;

#include "ground_truth/place.glsl"

void main() {
    vec4 ray = texelFetch(u_rays, ivec2(gl_FragCoord.xy), 0);
    out_place = vec4(place_of(u_rig_from_optical * ray.xyz), ray.w);
}
