// Vertex details that few materials need, in a table besides the vertex buffer.
// void pass_details(): with REFLECTANCE, passes the material record of clusters, and with
//     SECOND_COORDINATES also the second texture coordinates.
// The table has one texel per vertex, see omnisim/rendering/opengl/world/scene_textures.py.

#if defined(REFLECTANCE) && defined(CLUSTERED)
#define RECORD_IN_DETAILS
flat out int v_record;
#endif
#ifdef SECOND_COORDINATES
out vec2 v_second_coordinate;
#endif

#if defined(RECORD_IN_DETAILS) || defined(SECOND_COORDINATES)
uniform sampler2D u_vertex_details;

void pass_details() {
    int width = textureSize(u_vertex_details, 0).x;
    ivec2 place = ivec2(gl_VertexID % width, gl_VertexID / width);
    vec4 details = texelFetch(u_vertex_details, place, 0);
#ifdef RECORD_IN_DETAILS
    v_record = int(details.z);
#endif
#ifdef SECOND_COORDINATES
    v_second_coordinate = details.xy;
#endif
}
#else
void pass_details() {}
#endif
