// Body of thick glass, approximated by its front: a ray enters there, and leaves at a back that has
// the front's curvature, and is as far behind the center of the body's probe. For balls, and for
// plates around the center, this is exact.
// void make_glass(inout Reflectance surface, float cosine): makes it a mirror of Fresnel's
//     reflectance; cosine: that of the angle of incidence.
// vec3 glass_light(vec3 base_color, vec3 position, vec3 normal, vec3 view): light, linear RGB, that
//     passes the body toward the viewpoint. position: meters from the viewpoint; unit vectors in
//     world axes; view: toward the viewpoint. Call it before any branch.
// Twin of omnisim/rendering/rays/shading/ray_optics.py, which traces the mesh.

uniform vec3 u_glass_absorption_per_m;  // linear RGB
uniform vec2 u_glass;                   // transmission, and index of refraction
const float MIN_HALF = 0.05;            // half thickness, in distances from the center

float glass_reflectance(float cosine, float ior) {
    cosine = clamp(cosine, 1e-4, 1.0);
    float inside = sqrt(max(1.0 - (1.0 - cosine * cosine) / (ior * ior), 0.0));
    float across = (cosine - ior * inside) / (cosine + ior * inside);
    float along = (inside - ior * cosine) / (inside + ior * cosine);
    return 0.5 * (across * across + along * along);
}

void make_glass(inout Reflectance surface, float cosine) {
    surface.f90 = glass_reflectance(cosine, u_glass.y);
    surface.f0 = vec3(surface.f90);
    surface.roughness = MIN_ROUGHNESS;
    surface.body *= 1.0 - u_glass.x;
}

// Curvature of the surface along a direction, 1/m, by differences between texels.
float curvature_along(vec3 direction, vec3 position, vec3 normal) {
    vec3 right = dFdx(position), down = dFdy(position);
    float a = dot(right, right), b = dot(right, down), c = dot(down, down);
    float first = dot(right, direction), second = dot(down, direction);
    vec3 turned = (c * first - b * second) * dFdx(normal) + (a * second - b * first) * dFdy(normal);
    float scale = (a * c - b * b) * dot(direction, direction);
    return scale > 0.0 ? max(dot(turned, direction) / scale, 0.0) : 0.0;
}

vec3 glass_light(vec3 base_color, vec3 position, vec3 normal, vec3 view) {
    vec3 start = position - u_probe.xyz;
    float half_m = max(dot(start, normal), MIN_HALF * length(start));
    vec3 inside = refract(-view, normal, 1.0 / u_glass.y);
    vec3 beside = inside - dot(inside, normal) * normal;
    float curvature_per_m = min(curvature_along(beside, position, normal), 1.0 / half_m);
    // quadratic equation of the way to a back of this curvature
    float cosine = -dot(inside, normal), bent = half_m * curvature_per_m;
    float linear = cosine * (1.0 - 2.0 * bent);
    float root = sqrt(linear * linear + 4.0 * bent * (1.0 - bent));
    float range = linear > 0.0 ? 4.0 * half_m * (1.0 - bent) / (linear + root)
        : (root - linear) / max(curvature_per_m, 1e-9);
    vec3 back_normal = normalize(
        curvature_per_m * (2.0 * half_m * normal + range * inside) - normal);
    vec3 outside = refract(inside, -back_normal, u_glass.y);
    outside = dot(outside, outside) > 0.5 ? outside : inside;  // total reflection
    float spread = max(length(dFdx(outside)), length(dFdy(outside)));
    float passing = (1.0 - glass_reflectance(dot(normal, view), u_glass.y))
        * (1.0 - glass_reflectance(dot(back_normal, outside), u_glass.y));
    vec3 filtering = u_glass.x * base_color;
    filtering *= filtering * exp(-u_glass_absorption_per_m * range);
    return passing * filtering
        * reflected_probe(position + range * inside, outside, 0.0, spread);
}
