// terrain.vert - mesh vertices relative to the eye.
#include "frame.glsl"

layout(location = 0) in vec3 place;
out vec3 p;
invariant gl_Position; // one surface, whatever is asked of it

void main()
{
    p = place;
    gl_Position = clip_from_local * vec4(place, 1.0);
}
