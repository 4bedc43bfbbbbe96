// relief_plane.vert - the window of a relief's plane, four corners (core/relief/draw_prewarp.c).
#include "frame.glsl"

layout(location = 0) uniform vec3 corner; // eye-relative place of the window's (0, 0)
layout(location = 1) uniform vec3 side_u; // to its (1, 0) and (0, 1)
layout(location = 2) uniform vec3 side_v;

out vec2 st;

void main()
{
    st = vec2(gl_VertexID & 1, gl_VertexID >> 1);
    gl_Position = clip_from_local * vec4(corner + st.x * side_u + st.y * side_v, 1.0);
}
