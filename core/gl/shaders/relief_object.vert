// relief_object.vert - a rectangle of the picture, in px (row 0 at the top: GL_UPPER_LEFT).
#include "frame.glsl"

layout(location = 0) uniform vec4 rect; // x0, y0, x1, y1

void main()
{
    vec2 px = vec2((gl_VertexID & 1) != 0 ? rect.z : rect.x, (gl_VertexID & 2) != 0 ? rect.w : rect.y);
    gl_Position = vec4(2.0 * px / picture.xy - 1.0, 0.0, 1.0);
    gl_Position.y = -gl_Position.y;
}
