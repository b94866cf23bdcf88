// The scene's triangles for shaders that read them themselves: the two buffers, word by word.
// uint vertex_at(uint index): first word of the vertex that an entry of the index buffer names.
// vec3 position_at(uint at), normal_at(uint at): of the vertex there, in the frame of its mesh.
// The layout of a vertex is that in omnisim/gpu/scene/vertex_format.py, in words of 4 bytes.

layout(std430, binding = 0) readonly buffer Vertices { uint vertex_words[]; };
layout(std430, binding = 1) readonly buffer Indices { uint indices[]; };

const uint VERTEX_WORDS = 10u, NORMAL_WORD = 3u, TEXTURE_COORDINATE_WORD = 6u, ALPHA_WORD = 9u;

uint vertex_at(uint index) {
    return VERTEX_WORDS * indices[index];
}

vec3 words_at(uint at) {
    return uintBitsToFloat(
        uvec3(vertex_words[at], vertex_words[at + 1u], vertex_words[at + 2u]));
}

vec3 position_at(uint at) {
    return words_at(at);
}

vec3 normal_at(uint at) {
    return words_at(at + NORMAL_WORD);
}
