// sky.frag - clear sky, sun and glow.
#include "light.glsl"

layout(location = 0) out vec4 color;

void main()
{
    color = vec4(light_sky(normalize(frame_ray(gl_FragCoord.xy))), 1.0);
}
