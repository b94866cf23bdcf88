// bool ray_from_pixel(vec2 pixel_px, out vec3 ray): Scaramuzza's polynomial model. The ray is a
// unit direction in the optical frame; false past the domain's largest radius.
// Twin of omnisim/cameras/models/ocamcalib.py. Source: Scaramuzza et al. 2006, see there.

const int COEFFICIENTS = 8;

uniform vec2 u_principal_point_px;
uniform mat2 u_axes_from_pixels;
uniform float u_polynomial[COEFFICIENTS];  // a0 ... a7: coefficients of the powers of rho/rho_max
uniform float u_radius_max_px;

bool ray_from_pixel(vec2 pixel_px, out vec3 ray) {
    vec2 plane = u_axes_from_pixels * (pixel_px - u_principal_point_px) / u_radius_max_px;
    float radius = length(plane);
    plane /= max(radius, 1.0);
    float share = min(radius, 1.0), height = 0.0;
    for (int i = COEFFICIENTS - 1; i >= 0; --i) height = height * share + u_polynomial[i];
    ray = normalize(vec3(plane, -height));
    return radius <= 1.0;
}
