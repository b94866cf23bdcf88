// ivec2 nearest_texel(vec3 texel, Hit hit): texel nearest to a ray's own that shows the hit
// triangle, else the triangle's draw item, else any surface.

// Penalties on the squared distance, in texels², larger than any distance within the block.
const float OTHER_TRIANGLE = 16.0, OTHER_ITEM = 32.0;

ivec2 nearest_texel(vec3 texel, Hit hit) {
    ivec2 own_texel = ivec2(floor(texel.xy)), nearest = own_texel;
    uint ids[TEXELS] = ids_around(own_texel);
    float least = INFINITE;
    for (uint at = 0u; at < TEXELS; ++at) {
        if (ids[at] == 0u) continue;  // no surface
        vec2 away = vec2(own_texel + texel_offset(at)) + 0.5 - texel.xy;
        float distance = at == OWN ? 0.0 : dot(away, away);  // the ray's own texel is the nearest
        // no texel may show a triangle that is small or just beyond an edge
        if (ids[at] != hit.triangle_id)
            distance += primitive_at(ids[at]).x == hit.primitive.x ? OTHER_TRIANGLE : OTHER_ITEM;
        if (distance < least) {
            least = distance;
            nearest = own_texel + texel_offset(at);
        }
    }
    return nearest;
}
