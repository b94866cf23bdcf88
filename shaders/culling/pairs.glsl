// Pairs of a view and a cluster that it shows, and which triangles of it are drawn.
// Bound after culling/instances.comp, which needs other buffers there.

// [view][cluster]: first triangle and number of triangles to draw; then the pairs of a pass.
layout(std430, binding = 0) buffer Pairs { uint pairs[]; };

const uint COUNT_BITS = 7u;  // a cluster has at most 64 triangles

uint pair_of(uint view, uint cluster) {
    return view * u_clusters + cluster;
}

uint listed_place(uint at) {
    return u_cameras * u_tiles * u_clusters + at;
}
