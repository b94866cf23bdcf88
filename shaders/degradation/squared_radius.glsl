// float squared_radius(vec2 pixel_px): square of the image radius, in units of half the image's
// shorter side. Twin of omnisim/rendering/camera/degradations/image_geometry.py.

uniform vec2 u_center_px;
uniform float u_inverse_radius_unit;  // 1/px

float squared_radius(vec2 pixel_px) {
    vec2 scaled = (pixel_px - u_center_px) * u_inverse_radius_unit;
    return scaled.x * scaled.x + scaled.y * scaled.y;
}
