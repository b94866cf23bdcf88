// bool ray_from_pixel(vec2 pixel_px, out vec3 ray): the cylindrical panorama around the optical
// frame's y axis. The ray is a unit direction; false past half a turn to either side.
// Twin of omnisim/cameras/models/cylindrical.py.

uniform float u_focal_length_px;  // pixels per radian of azimuth, and per tangent of 1
uniform vec2 u_principal_point_px;

const float HALF_TURN_RAD = 3.14159265358979;

bool ray_from_pixel(vec2 pixel_px, out vec3 ray) {
    vec2 scaled = (pixel_px - u_principal_point_px) / u_focal_length_px;
    ray = normalize(vec3(sin(scaled.x), scaled.y, cos(scaled.x)));
    return abs(scaled.x) <= HALF_TURN_RAD;
}
