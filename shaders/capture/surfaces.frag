// First surface of each pixel center's ray: its direction from the viewpoint, ray + w origin, and
// its nearness w (first_surface.glsl); w is negative if it is unknown or there is no ray.
#version 450 core

uniform sampler2D u_rays;  // as in parallax_rays.glsl
uniform sampler2D u_origins;
layout(location = 0) out vec4 out_surface;

#include "capture/first_surface.glsl"

const int MARGIN = 2;

void main() {
    ivec2 at = ivec2(gl_FragCoord.xy) + MARGIN;
    vec4 ray = texelFetch(u_rays, at, 0);
    vec4 origin = texelFetch(u_origins, at, 0);
    FirstSurface found = first_surface(ray.xyz, origin.xyz, largest_nearness());
    bool known = found.known && ray.xyz != vec3(0.0);
    out_surface = vec4(ray.xyz + found.nearness * origin.xyz, known ? found.nearness : -1.0);
}
