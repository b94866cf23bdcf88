// Panes of glass, of which one surface represents both interfaces.
// void make_pane(inout Reflectance surface, float cosine): makes it a mirror of a pane's
//     reflectance; cosine: that of the angle of incidence.
// vec3 transmittance(vec3 base_color, vec3 triangle_normal): factors of the light behind the pane,
//     linear RGB.
// Twin of omnisim/rendering/rays/shading/panes.py, which has the sources.

float pane_reflectance(float cosine, float ior) {
    cosine = clamp(cosine, 1e-4, 1.0);
    float inside = sqrt(max(1.0 - (1.0 - cosine * cosine) / (ior * ior), 0.0));
    float across = (cosine - ior * inside) / (cosine + ior * inside);
    float along = (inside - ior * cosine) / (inside + ior * cosine);
    float once = 0.5 * (across * across + along * along);
    return 2.0 * once / (1.0 + once);
}

void make_pane(inout Reflectance surface, float cosine) {
    surface.f90 = pane_reflectance(cosine, material_texel(3).w);
    surface.f0 = vec3(surface.f90);
    surface.roughness = MIN_ROUGHNESS;
    surface.body *= 1.0 - material_texel(2).w;
}

vec3 transmittance(vec3 base_color, vec3 triangle_normal) {
    vec3 view = normalize(-surface_position());
    float cosine = abs(dot(seen_normal(triangle_normal), view));
    float ior = material_texel(3).w, passing = 1.0 - pane_reflectance(cosine, ior);
    vec3 color = base_color;
    if (material_texel(4).w > 0.0) {  // a slab: two faces, and the way between them
        float inside = sqrt(1.0 - (1.0 - cosine * cosine) / (ior * ior));
        color *= base_color * exp(-material_texel(19).rgb / max(inside, 1e-4));
    }
    return passing * material_texel(2).w * color;
}
