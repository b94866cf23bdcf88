// Boxes in the clip space of a view, and lists of candidates for the passes.

// Share of its distance by which a box is enlarged, because floats round its projection.
const float TOLERANCE = 2e-6;
const uint WORK_GROUP = 64u;  // work group size of the shader that reads a list

float reach(vec3 edges) {
    return dot(abs(edges), vec3(1.0));
}

struct ClipBox {
    vec3 center;  // x, y, w
    vec3 x_edges, y_edges, w_edges;
};

// Box of an instance, in the object's frame.
ClipBox clip_box(mat4 rows, vec3 center, vec3 extent, float margin) {
    vec4 at = vec4(center, 1.0);
    extent += TOLERANCE * (margin + reach(center) + reach(extent));
    return ClipBox(
        vec3(dot(rows[0], at), dot(rows[1], at), dot(rows[3], at)),
        rows[0].xyz * extent, rows[1].xyz * extent, rows[3].xyz * extent);
}

// False if the box is completely outside one plane of the frustum.
bool is_inside(ClipBox box) {
    float depth = reach(box.w_edges), x = box.center.x, y = box.center.y, w = box.center.z;
    return w + depth >= u_depths_m.x && w - depth <= u_depths_m.y
        && w + x + reach(box.w_edges + box.x_edges) >= 0.0
        && w - x + reach(box.w_edges - box.x_edges) >= 0.0
        && w + y + reach(box.w_edges + box.y_edges) >= 0.0
        && w - y + reach(box.w_edges - box.y_edges) >= 0.0;
}

// Index of a candidate in a list.
uint candidate_place(uint list, uint at) {
    uint part = list < TESTED ? 2u - (list & 1u) : 0u;
    return part * u_cameras * u_tiles * u_groups + at;
}

// Place of one more entry in a list.
uint take_place(uint list) {
    uint at = atomicAdd(lists[list].candidates, 1u);
    if (at % WORK_GROUP == 0u) atomicAdd(lists[list].work_groups, 1u);
    return at;
}

void append(uint list, Candidate candidate) {
    candidates[candidate_place(list, take_place(list))] = candidate;
}
