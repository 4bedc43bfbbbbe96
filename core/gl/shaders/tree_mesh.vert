// tree_mesh.vert - a tree's polygons: model space to local (frames.h: rotation clockwise seen from above, height 1 to metres).
#include "frame.glsl"
#ifdef SHADE
#include "tree_light.glsl"
#endif

layout(location = 0) in vec3 position;
layout(location = 1) in vec3 model_normal;
layout(location = 2) in float model_occlusion;
layout(location = 3) in vec2 uv;
layout(location = 4) in vec4 model_open; // slope of openness along x, y, z; its mean (mesh.h)
layout(location = 5) in vec4 place; // foot, eye-relative; height
layout(location = 6) in vec2 turn;  // cos, sin
layout(location = 7) in uint tree_id;
#ifdef SHADE
layout(location = 8) in vec4 first_light; // what arrives at the tree (tree_light.glsl)
layout(location = 9) in vec4 second_light;
layout(location = 2) uniform vec4 across; // struct sv_tree_light_axes
layout(location = 3) uniform vec4 along;
#endif

out vec3 local;
out vec3 normal;
out vec3 uv_occlusion;
out float sun_open;
flat out uint id;

vec3 turned(vec3 p)
{
    return vec3(turn.x * p.x + turn.y * p.y, turn.x * p.y - turn.y * p.x, p.z);
}

void main()
{
    vec3 p = turned(position);
    local = place.xyz + place.w * p;
    normal = turned(model_normal);
    uv_occlusion = vec3(uv, model_occlusion);
    sun_open = clamp(dot(turned(model_open.xyz), to_sun.xyz) + model_open.w, 0.0, 1.0); // sv_tree_vertex_open
#ifdef SHADE
    vec2 at = vec2(dot(across.xyz, p) + across.w, dot(along.xyz, p) + along.w);
    sun_open = min(sun_open * tree_crown(frame_to_viewer(local)), 1.0) * tree_light(at, first_light, second_light);
#endif
    id = tree_id;
    gl_Position = clip_from_local * vec4(local, 1.0);
}
