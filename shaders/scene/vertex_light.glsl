// Lightmap coordinates of vertices.
// void pass_light_coordinate(): with LIGHTMAP, passes the lightmap coordinates of each side.
// u_light_rectangles  lightmap regions (left, top, width, height) of an item's sides; coordinates
//     of clusters already include them

#ifdef LIGHTMAP
#ifdef BOTH_SIDES
#define SIDES 2
#define LIGHT_COORDINATE vec4
#else
#define SIDES 1
#define LIGHT_COORDINATE vec2
#endif
layout(location = 4) in LIGHT_COORDINATE in_light_coordinate;  // front side, then back side
out LIGHT_COORDINATE v_light_coordinate;
#ifdef CLUSTERED
void pass_light_coordinate() {
    v_light_coordinate = in_light_coordinate;
}
#else
uniform vec4 u_light_rectangles[SIDES];

void pass_light_coordinate() {
    for (int side = 0; side < SIDES; ++side) {
        vec4 rectangle = u_light_rectangles[side];
        int at = 2 * side;
        vec2 own = vec2(in_light_coordinate[at], in_light_coordinate[at + 1]);
        own = rectangle.xy + own * rectangle.zw;
        v_light_coordinate[at] = own.x;
        v_light_coordinate[at + 1] = own.y;
    }
}
#endif
#else
void pass_light_coordinate() {}
#endif
