// Position of a vertex of the scene.
// vec4 clip_position(): position in clip space; for clusters, it also sets the clip distances to
//     the edges of the tile.
// With CLUSTERED, all tiles of the atlas are drawn at once; the draw call's base instance selects
// object and view. Otherwise one item is drawn in one tile, which is the viewport.
// With LAYERED, each camera has a layer of the target. Include this file first: it enables
// extensions.
// u_clip_from_mesh  pose and projection of the face; y of clip space points down the image
// All programs share the vertex arrays of clusters, so attributes have the same locations
// everywhere: the order of CLUSTER_VERTEX and INSTANCE in
// omnisim/rendering/opengl/world/vertex_format.py.

#ifdef LAYERED
#extension GL_ARB_shader_draw_parameters : require
#extension GL_ARB_shader_viewport_layer_array : require
#include "culling/settings.glsl"
flat out int v_camera;
#endif

invariant gl_Position;  // bit-identical vertices in batches and in single frames

layout(location = 0) in vec3 in_position;

#ifdef IN_MIRROR
out float gl_ClipDistance[5];  // the last one is that of scene/mirror_clip.glsl
#endif
#ifdef CLUSTERED
layout(location = 5) in mat4 in_clip_from_object;
layout(location = 9) in vec4 in_placement;  // scale and shift of the tile in the atlas
#ifndef IN_MIRROR
out float gl_ClipDistance[4];
#endif

vec4 clip_position() {
    vec4 clip = in_clip_from_object * vec4(in_position, 1.0);
    gl_ClipDistance[0] = clip.w + clip.x;
    gl_ClipDistance[1] = clip.w - clip.x;
    gl_ClipDistance[2] = clip.w + clip.y;
    gl_ClipDistance[3] = clip.w - clip.y;
#ifdef LAYERED
    v_camera = int(uint(gl_BaseInstanceARB) % (u_cameras * u_tiles) / u_tiles);
    gl_Layer = v_camera;
#endif
    return vec4(clip.xy * in_placement.xy + clip.w * in_placement.zw, clip.zw);
}
#else
uniform mat4 u_clip_from_mesh;

vec4 clip_position() {
    return u_clip_from_mesh * vec4(in_position, 1.0);
}
#endif
