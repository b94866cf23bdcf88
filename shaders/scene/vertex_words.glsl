// Vertex and index buffers as 4-byte words, for shaders that fetch the scene's triangles directly.
// uint vertex_at(uint index): first word of the vertex of an entry of the index buffer.
// vec3 position_at(uint at), normal_at(uint at): position and normal of that vertex, mesh frame.
// uint vertex_word(uint at), index_word(uint at): words of the buffers.
// The layout of a vertex is that of omnisim/rendering/opengl/world/vertex_format.py.
// With WINDOW_WORD_BITS, the buffers exceed the size limit of a binding. They are bound in windows
// of 2^WINDOW_WORD_BITS words, see omnisim/rendering/opengl/world/geometry_store.py.

layout(std430, binding = 0) readonly buffer Vertices { uint vertex_words[]; };
layout(std430, binding = 1) readonly buffer Indices { uint indices[]; };

#ifdef WINDOW_WORD_BITS
layout(std430, binding = 8) readonly buffer Vertices1 { uint vertex_words_1[]; };
layout(std430, binding = 9) readonly buffer Vertices2 { uint vertex_words_2[]; };
layout(std430, binding = 10) readonly buffer Indices1 { uint indices_1[]; };
layout(std430, binding = 11) readonly buffer Indices2 { uint indices_2[]; };

const uint WINDOW_MASK = (1u << WINDOW_WORD_BITS) - 1u;

uint vertex_word(uint at) {
    uint window = at >> WINDOW_WORD_BITS, place = at & WINDOW_MASK;
    if (window == 0u) return vertex_words[place];
    return window == 1u ? vertex_words_1[place] : vertex_words_2[place];
}

uint index_word(uint at) {
    uint window = at >> WINDOW_WORD_BITS, place = at & WINDOW_MASK;
    if (window == 0u) return indices[place];
    return window == 1u ? indices_1[place] : indices_2[place];
}
#else
#define vertex_word(at) vertex_words[at]
#define index_word(at) indices[at]
#endif

const uint VERTEX_WORDS = 10u, NORMAL_WORD = 3u, TEXTURE_COORDINATE_WORD = 6u, ALPHA_WORD = 9u;

uint vertex_at(uint index) {
    return VERTEX_WORDS * index_word(index);
}

vec3 words_at(uint at) {
    return uintBitsToFloat(
        uvec3(vertex_word(at), vertex_word(at + 1u), vertex_word(at + 2u)));
}

vec3 position_at(uint at) {
    return words_at(at);
}

vec3 normal_at(uint at) {
    return words_at(at + NORMAL_WORD);
}
