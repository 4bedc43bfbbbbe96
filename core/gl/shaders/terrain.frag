// terrain.frag - the ground's id and normal, and its depth; its colour is core/terrain/ground.c's.
// DEPTH_ONLY: nothing else is wanted.
#include "frame.glsl"

in vec3 p;

#ifdef DEPTH_ONLY
void main()
{
}
#else
layout(binding = 0) uniform sampler2D normal_map; // (x, y) * 127 + 128 at samples
layout(location = 0) uniform vec4 normal_uv;      // scale, offset from local x, y
layout(location = 1) uniform uint id_terrain;

layout(location = 1) out uint id;
layout(location = 2) out vec4 normal;

void main()
{
    vec2 xy = texture(normal_map, p.xy * normal_uv.xy + normal_uv.zw).rg * (255.0 / 127.0) - 128.0 / 127.0;
    id = id_terrain;
    normal = vec4(normalize(vec3(xy, sqrt(max(0.0, 1.0 - dot(xy, xy))))), 0.0);
}
#endif
