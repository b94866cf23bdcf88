// Details of vertices that few materials need, from a table beside the vertex buffer.
// void pass_details(): the record of the material, of clusters; and the second texture coordinates.
// The table has one texel a vertex, see omnisim/rendering/opengl/materials/material_table.py.

#if defined(CLUSTERED) || defined(SECOND_COORDINATES)
uniform sampler2D u_vertex_details;

vec4 vertex_details() {
    int width = textureSize(u_vertex_details, 0).x;
    return texelFetch(u_vertex_details, ivec2(gl_VertexID % width, gl_VertexID / width), 0);
}
#endif
#ifdef CLUSTERED
flat out int v_record;
#endif
#ifdef SECOND_COORDINATES
out vec2 v_second_coordinate;
#endif

void pass_details() {
#if defined(CLUSTERED) || defined(SECOND_COORDINATES)
    vec4 details = vertex_details();
#endif
#ifdef CLUSTERED
    v_record = int(details.z);
#endif
#ifdef SECOND_COORDINATES
    v_second_coordinate = details.xy;
#endif
}
