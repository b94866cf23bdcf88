// Deformation of vertices: morph targets, then linear blend skinning. Twin of
// omnisim/scene/motion/deformation.py.
// The layouts are those of omnisim/rendering/opengl/world/mesh_deformer.py and vertex_format.py.
// Source: glTF 2.0, sections 3.7.2.2 and 3.7.3.3; normals use the cofactor matrix.
#version 450 core

layout(local_size_x = 64) in;

struct Bound {
    vec3 position;     // bind pose
    uint vertex;       // index in the vertex buffer
    vec3 normal;       // bind pose; 0: flat shading
    uint first_offset; // index of the first target's offset
    uvec4 joints[2];
    vec4 shares[2];    // weights of the joints, with sum 1
    uvec4 targets;     // first weight, number of targets, stride between their offsets
};

struct Offset {
    vec4 position, normal;
};

layout(std430, binding = 0) buffer Vertices { uint vertex_words[]; };
layout(std430, binding = 1) readonly buffer Bounds { Bound bounds[]; };
layout(std430, binding = 2) readonly buffer Offsets { Offset offsets[]; };
layout(std430, binding = 3) readonly buffer Matrices { vec4 rows_of_joints[]; };  // 3 per joint
layout(std430, binding = 4) readonly buffer Weights { float weights[]; };

const uint VERTEX_WORDS = 10u, NORMAL_WORD = 3u;

uniform uint u_count;

void write(uint at, vec3 value) {
    uvec3 bits = floatBitsToUint(value);
    vertex_words[at] = bits.x;
    vertex_words[at + 1u] = bits.y;
    vertex_words[at + 2u] = bits.z;
}

void main() {
    uint index = gl_GlobalInvocationID.x;
    if (index >= u_count) return;
    Bound bound = bounds[index];
    vec3 position = bound.position, normal = bound.normal;
    for (uint target = 0u; target < bound.targets.y; ++target) {
        float weight = weights[bound.targets.x + target];
        Offset offset = offsets[bound.first_offset + target * bound.targets.z];
        position += weight * offset.position.xyz;
        normal += weight * offset.normal.xyz;
    }
    vec4 rows[3] = vec4[3](vec4(0.0), vec4(0.0), vec4(0.0));
    for (uint k = 0u; k < 8u; ++k) {
        float share = bound.shares[k / 4u][k % 4u];
        if (share == 0.0) continue;
        uint first = 3u * bound.joints[k / 4u][k % 4u];
        for (uint row = 0u; row < 3u; ++row) rows[row] += share * rows_of_joints[first + row];
    }
    vec4 extended = vec4(position, 1.0);
    uint at = VERTEX_WORDS * bound.vertex;
    write(at, vec3(dot(rows[0], extended), dot(rows[1], extended), dot(rows[2], extended)));
    if (bound.normal == vec3(0.0)) return;
    vec3 x = cross(rows[1].xyz, rows[2].xyz), y = cross(rows[2].xyz, rows[0].xyz);
    vec3 z = cross(rows[0].xyz, rows[1].xyz);
    vec3 turned = vec3(dot(x, normal), dot(y, normal), dot(z, normal));
    turned *= dot(rows[0].xyz, x) < 0.0 ? -1.0 : 1.0;
    float size = length(turned);
    write(at + NORMAL_WORD, size > 0.0 ? turned / size : turned);
}
