// vec3 neutral(vec3 linear): linear light mapped to [0, 1] by Khronos's PBR Neutral tone curve.
// Twin of omnisim/rendering/camera/degradations/encoding.py.
// Source: Khronos Group, "PBR Neutral Tone Mapper Specification", 2024.

vec3 neutral(vec3 linear) {
    const float start = 0.76, room = 1.0 - start;
    float least = max(min(linear.r, min(linear.g, linear.b)), 0.0);
    vec3 color = linear - (least < 0.08 ? least - 6.25 * least * least : 0.04);
    float peak = max(color.r, max(color.g, color.b));
    if (peak < start) return color;
    float lowered = 1.0 - room * room / (peak + room - start);
    float gray = 1.0 - 1.0 / (0.15 * (peak - lowered) + 1.0);
    return mix(color * lowered / peak, vec3(lowered), gray);
}
