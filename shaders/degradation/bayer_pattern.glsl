// int color_of(ivec2 pixel): color of a pixel in the mosaic: 0 red, 1 green, 2 blue.

uniform ivec2 u_red_xy;  // column and row of red in the 2 x 2 pattern

int color_of(ivec2 pixel) {
    ivec2 odd = (pixel + u_red_xy) & 1;
    return odd.x + odd.y;
}
