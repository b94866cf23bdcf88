// vec2 sky_coordinates(vec3 direction): texture coordinates of a unit vector, in world axes, in an
// environment map. Twin of coordinates_of in omnisim/scene/light/environment.py.

const float TURN = 6.28318530717959;

vec2 sky_coordinates(vec3 direction) {
    // straight up or down, the azimuth is arbitrary but must be finite
    float azimuth = direction.xy == vec2(0.0) ? 0.0 : atan(direction.y, direction.x);
    return vec2(0.5 - azimuth / TURN, acos(clamp(direction.z, -1.0, 1.0)) / (0.5 * TURN));
}
