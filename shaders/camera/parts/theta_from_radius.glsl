// float theta_from_radius(float radius, float low_rad, float high_rad): angle between two bounds at
// which a lens has a given radius. Include this file after
//     float radius_from_theta(float theta_rad), increasing between the bounds, and
//     float slope_from_theta(float theta_rad), its derivative.
// Newton's method starts at the radius itself, which in focal lengths is nearly the angle. A step
// that leaves the bracket, or crosses more than half of it, is replaced by a bisection: two angles
// of a stretched lens could otherwise lead to each other forever.
// Twin of omnisim/cameras/lens_polynomials.py.

const int STEPS = 24;  // bisections alone reach the last bit of a float

float theta_from_radius(float radius, float low_rad, float high_rad) {
    float low = low_rad, high = high_rad, theta = clamp(radius, low_rad, high_rad);
    for (int i = 0; i < STEPS; ++i) {
        float error = radius_from_theta(theta) - radius;
        if (error <= 0.0) low = theta;
        if (error >= 0.0) high = theta;
        float slope = slope_from_theta(theta);
        float newton = theta - error / max(slope, 1e-9);
        bool inside = newton >= low && newton <= high;
        inside = inside && abs(newton - theta) <= 0.5 * (high - low);
        theta = inside ? newton : 0.5 * (low + high);
    }
    return theta;
}
