// object_mesh.vert - an object's polygons: model space to local (frames.h: clockwise seen from above, height 1 to metres).
#include "frame.glsl"

layout(location = 0) in vec3 position;
layout(location = 1) in vec3 model_normal;
layout(location = 2) in float model_occlusion;
layout(location = 3) in vec2 uv;

layout(location = 0) uniform vec4 place; // foot, eye-relative; height
layout(location = 1) uniform vec2 turn;  // cos, sin
// A place in heights from the foot, in the shadow map: texels to the right and down, heights along the light (core/relief/object_sun.h).
layout(location = 2) uniform vec4 sun_right;
layout(location = 3) uniform vec4 sun_down;
layout(location = 4) uniform vec4 sun_travel;

out vec3 local;
out vec3 normal;
out vec3 uv_occlusion;
out vec3 in_sun_map;

vec3 turned(vec3 p)
{
    return vec3(turn.x * p.x + turn.y * p.y, turn.x * p.y - turn.y * p.x, p.z);
}

void main()
{
    vec4 q = vec4(turned(position), 1.0);
    local = place.xyz + place.w * q.xyz;
    normal = turned(model_normal);
    uv_occlusion = vec3(uv, model_occlusion);
    in_sun_map = vec3(dot(sun_right, q), dot(sun_down, q), dot(sun_travel, q));
    gl_Position = clip_from_local * vec4(local, 1.0);
}
