// Rays of an image's pixels; with BATCH, of several images stacked vertically.
// ivec2 pixel(): pixel of the fragment in its own image.
// mat3 viewpoint_from_optical(): rotation of the image's camera; in a batch, the entry after the
// image's last draw item.

uniform sampler2D u_rays;  // unit direction in the optical frame, and 1 if the pixel has a ray

#ifdef BATCH
mat3 viewpoint_from_optical() {
    vec4 rows[3] = matrix_at(u_draw_item_count - 1u, VIEWPOINT_FROM_MESH);
    return transpose(mat3(rows[0].xyz, rows[1].xyz, rows[2].xyz));
}

ivec2 pixel() {
    return ivec2(gl_FragCoord.xy) - ivec2(0, v_image * textureSize(u_rays, 0).y);
}
#else
uniform mat3 u_viewpoint_from_optical;

mat3 viewpoint_from_optical() {
    return u_viewpoint_from_optical;
}

ivec2 pixel() {
    return ivec2(gl_FragCoord.xy);
}
#endif
