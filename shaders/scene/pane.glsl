// Panes of glass, of which one surface represents both interfaces, and slabs, which are panes with
// two faces and a way between them.
// void make_pane(inout Reflectance surface, vec3 base_color, vec3 position, vec3 normal,
//     vec3 triangle_normal): makes it a mirror of a pane's reflectance.
// vec3 transmittance(vec3 base_color, vec3 triangle_normal): factors of the light behind the pane,
//     linear RGB.
// Twin of omnisim/rendering/rays/shading/ray_optics.py, which has the sources.

uniform mat3 u_normal_from_mesh;  // as in scene/vertex_placement.glsl
uniform vec3 u_slab_normal;       // normal of both faces of a slab, frame of the mesh; or 0
const float MAX_BOUNCES = 6.0;    // omnisim/rendering/rays/shading/ray_optics.py

float interface_reflectance(float cosine, float ior) {
    cosine = clamp(cosine, 1e-4, 1.0);
    float inside = sqrt(max(1.0 - (1.0 - cosine * cosine) / (ior * ior), 0.0));
    float across = (cosine - ior * inside) / (cosine + ior * inside);
    float along = (inside - ior * cosine) / (inside + ior * cosine);
    return 0.5 * (across * across + along * along);
}

float pane_reflectance(float once) {
    return 2.0 * once / (1.0 + once);
}

bool is_slab() {
    return material_texel(4).w > 0.0;
}

// Light that is left between the faces of a slab, by the cosine to their normal in the glass.
vec3 left_between(float inside) {
    return exp(-material_texel(19).rgb / max(inside, 1e-4));
}

vec3 left_across(float cosine, float ior) {
    return left_between(sqrt(1.0 - (1.0 - cosine * cosine) / (ior * ior)));
}

vec3 slab_normal() {
    vec3 normal = u_normal_from_mesh * u_slab_normal;
    return normal / max(length(normal), 1e-30);
}

bool is_rim(vec3 triangle_normal) {
    vec3 normal = slab_normal();
    float along = abs(dot(normal, triangle_normal));
    return dot(normal, normal) > 0.0 && along < 0.5 * length(triangle_normal);
}

// Light behind the rim of a slab: its faces reflect all of it, up to the last bounce of a path,
// which shows the surroundings.
vec3 rim_light(vec3 base_color, vec3 position, vec3 normal) {
    vec3 view = normalize(-position), light = light_of_surroundings(position, normal, normal);
    vec3 left = left_between(abs(dot(view, slab_normal())) / material_texel(3).w);
    return material_texel(2).w * base_color * pow(left, vec3(MAX_BOUNCES))
        * surroundings(-view, MIN_ROUGHNESS, normal, light);
}

void make_pane(
    inout Reflectance surface, vec3 base_color, vec3 position, vec3 normal, vec3 triangle_normal) {
    float cosine = abs(dot(normal, normalize(-position))), ior = material_texel(3).w;
    float once = interface_reflectance(cosine, ior);
    vec3 reflected = vec3(pane_reflectance(once));
    if (is_rim(triangle_normal)) {
        reflected = vec3(once);
        surface.emissive += (1.0 - once) * rim_light(base_color, position, normal);
    } else if (is_slab()) {
        vec3 left = left_across(cosine, ior), entered = (1.0 - once) * base_color * left;
        reflected = once + once * entered * entered / (1.0 - once * once * left * left);
    }
    surface.f90 = largest(reflected);
    surface.f0 = reflected;
    surface.roughness = MIN_ROUGHNESS;
    surface.body *= 1.0 - material_texel(2).w;
}

vec3 transmittance(vec3 base_color, vec3 triangle_normal) {
    if (is_rim(triangle_normal)) return vec3(0.0);
    float cosine = abs(dot(seen_normal(triangle_normal), normalize(-surface_position())));
    float ior = material_texel(3).w, once = interface_reflectance(cosine, ior);
    float share = material_texel(2).w;
    if (!is_slab()) return (1.0 - pane_reflectance(once)) * share * base_color;
    vec3 left = left_across(cosine, ior), entered = (1.0 - once) * base_color;
    return share * entered * entered * left / (1.0 - once * once * left * left);
}
