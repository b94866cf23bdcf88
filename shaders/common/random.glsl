// uvec4 pcg4d(uvec4 v): four hashes of four coordinates.
// float uniform_number(uint hash): uniformly distributed number in (0, 1), ends excluded; exact.
// float normal_number(uint first, uint second): normally distributed number, mean 0, variance 1.
// Bit-identical twin of omnisim/core/random_numbers.py.
// Source: Jarzynski and Olano, "Hash Functions for GPU Rendering", JCGT 9(3), 2020; Box and Muller.

uvec4 pcg4d(uvec4 v) {
    v = v * 1664525u + 1013904223u;
    v.x += v.y * v.w; v.y += v.z * v.x; v.z += v.x * v.y; v.w += v.y * v.z;
    v ^= v >> 16u;
    v.x += v.y * v.w; v.y += v.z * v.x; v.z += v.x * v.y; v.w += v.y * v.z;
    return v;
}

// 23 bits plus one half: they fit in a float's mantissa, so that nothing rounds up to 1
float uniform_number(uint hash) { return (float(hash >> 9u) + 0.5) * 1.1920928955078125e-7; }

float normal_number(uint first, uint second) {
    return sqrt(-2.0 * log(uniform_number(first)))
        * cos(6.28318530717958648 * uniform_number(second));
}
